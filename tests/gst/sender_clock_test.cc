// SPDX-License-Identifier: LGPL-2.1-or-later
#include "camsrc/camera_chain.h"

#include "support/test.h"

namespace lf::test {
namespace {

constexpr GstClockTime kLatency = 200 * GST_MSECOND;
constexpr GstClockTime kNow = 1'700'000'000 * GST_SECOND, kStamp = 5 * GST_SECOND;

std::shared_ptr<SenderClock> clock_of(GstClockTimeDiff age) {
  auto clock = std::make_shared<SenderClock>(kLatency);
  clock->see(kStamp, kNow - static_cast<GstClockTime>(age), kNow);
  return clock;
}

TEST(SenderClock, UnknownBeforeAReport) {
  const SenderClock clock(kLatency);
  EXPECT_FALSE(clock.is_known());
  EXPECT_EQ(clock.taken(kStamp), std::nullopt);
}

TEST(SenderClock, UsesTheTimesOfTheSender) {
  const auto clock = clock_of(300 * GST_MSECOND);
  EXPECT_TRUE(clock->is_known());
  EXPECT_EQ(clock->taken(kStamp), kNow - 300 * GST_MSECOND);
  EXPECT_EQ(clock->taken(kStamp + 40 * GST_MSECOND), kNow - 260 * GST_MSECOND);
  EXPECT_EQ(clock->taken(kStamp - 40 * GST_MSECOND), kNow - 340 * GST_MSECOND);
}

TEST(SenderClock, RejectsImplausibleTimes) {
  EXPECT_TRUE(clock_of(-50 * GST_MSECOND)->is_known()) << "clocks may differ slightly";
  EXPECT_FALSE(clock_of(-GST_SECOND)->is_known()) << "received before it was sent";
  EXPECT_TRUE(clock_of(kLatency + 1900 * GST_MSECOND)->is_known());
  EXPECT_FALSE(clock_of(kLatency + 3 * GST_SECOND)->is_known());
  EXPECT_FALSE(clock_of(kNow - GST_SECOND)->is_known()) << "clock starts in 1970";
}

TEST(SenderClock, AcceptsAClockThatIsSetLater) {
  const auto clock = clock_of(kNow - GST_SECOND);
  clock->see(kStamp + GST_SECOND, kNow + GST_SECOND - kLatency, kNow + GST_SECOND);
  EXPECT_EQ(clock->taken(kStamp + GST_SECOND), kNow + GST_SECOND - kLatency);
}

// A source of RTP packets like rtspsrc, with sometimes pads.
struct FakeRtspSrc {
  GstElement parent;
  gboolean adds_meta;
};
struct FakeRtspSrcClass {
  GstElementClass parent_class;
};
G_DEFINE_TYPE(FakeRtspSrc, fake_rtsp_src, GST_TYPE_ELEMENT)
void set_meta(GObject* object, guint, const GValue* value, GParamSpec*) {
  reinterpret_cast<FakeRtspSrc*>(object)->adds_meta = g_value_get_boolean(value);
}
void fake_rtsp_src_class_init(FakeRtspSrcClass* klass) {
  G_OBJECT_CLASS(klass)->set_property = set_meta;
  g_object_class_install_property(
      G_OBJECT_CLASS(klass), 1,
      g_param_spec_boolean("add-reference-timestamp-meta", "", "", FALSE,
                           static_cast<GParamFlags>(G_PARAM_WRITABLE | G_PARAM_STATIC_STRINGS)));
}
void fake_rtsp_src_init(FakeRtspSrc*) {}

class SenderClockPackets : public testing::TestWithParam<const char*> {};

// Feeds the packets of a pad with these media; running time starts at 0.
TEST_P(SenderClockPackets, AreForwardedAndRead) {
  auto* source = static_cast<GstElement*>(gst_object_ref_sink(g_object_new(fake_rtsp_src_get_type(), nullptr)));
  const auto clock = std::make_shared<SenderClock>(kLatency);
  clock->watch(source);
  EXPECT_TRUE(reinterpret_cast<FakeRtspSrc*>(source)->adds_meta);
  GstPad* pad = gst_pad_new("stream_0", GST_PAD_SRC);
  GstPad* sink = gst_pad_new("sink", GST_PAD_SINK);
  gst_object_ref_sink(sink);
  static int received;
  received = 0;
  gst_pad_set_chain_function(sink, [](GstPad*, GstObject*, GstBuffer* buffer) {
    gst_buffer_unref(buffer);
    received++;
    return GST_FLOW_OK;
  });
  gst_pad_set_active(pad, TRUE);
  gst_pad_set_active(sink, TRUE);
  gst_pad_push_event(pad, gst_event_new_stream_start("test"));
  GstCaps* caps = gst_caps_new_simple("application/x-rtp", "media", G_TYPE_STRING, GetParam(), nullptr);
  gst_pad_push_event(pad, gst_event_new_caps(caps));
  gst_caps_unref(caps);
  GstSegment segment;
  gst_segment_init(&segment, GST_FORMAT_TIME);
  segment.start = GST_SECOND;
  gst_pad_push_event(pad, gst_event_new_segment(&segment));
  gst_element_add_pad(source, pad);
  gst_pad_link(pad, sink);

  const auto packet = [](GstClockTime pts, std::optional<GstClockTime> sent) {
    GstBuffer* buffer = gst_buffer_new();
    GST_BUFFER_PTS(buffer) = pts;
    GstCaps* ntp = gst_caps_new_empty_simple("timestamp/x-ntp");
    if (sent)
      gst_buffer_add_reference_timestamp_meta(buffer, ntp, *sent + 2'208'988'800 * GST_SECOND, GST_CLOCK_TIME_NONE);
    gst_caps_unref(ntp);
    return buffer;
  };
  const GstClockTime sent = static_cast<GstClockTime>(g_get_real_time()) * GST_USECOND - kLatency;
  gst_pad_push(pad, packet(GST_SECOND, std::nullopt));
  EXPECT_FALSE(clock->is_known());
  gst_pad_push(pad, packet(GST_SECOND, sent));
  GstBufferList* list = gst_buffer_list_new();
  gst_buffer_list_add(list, packet(2 * GST_SECOND, sent + GST_SECOND / 100 * 99));
  gst_buffer_list_add(list, packet(2 * GST_SECOND, std::nullopt));
  const bool video = g_str_equal(GetParam(), "video");
  EXPECT_EQ(clock->taken(0), video ? std::optional(sent) : std::nullopt);
  gst_pad_push_list(pad, list);
  EXPECT_EQ(received, 4);
  EXPECT_EQ(clock->is_known(), false) << "sent almost a second in the future";
  gst_object_unref(source);
  gst_object_unref(sink);
}
INSTANTIATE_TEST_SUITE_P(, SenderClockPackets, testing::Values("video", "audio"));

}  // namespace
}  // namespace lf::test
