// SPDX-License-Identifier: LGPL-2.1-or-later
//
// Negotiation with downstream: memory and formats of pictures, and QoS.

#include "gst/compositor_fixture.h"

namespace lf::test {
namespace {

class LfCompositorDownstreamTest : public LfCompositorTest {
 protected:
  ~LfCompositorDownstreamTest() override {
    harness_.reset();
    gst_clear_object(&pool_);
  }

  // Downstream answers ALLOCATION queries with `pool_`, or fails the query if `fails_`.
  void answer_allocation() {
    constexpr auto kQueries = GstPadProbeType(GST_PAD_PROBE_TYPE_QUERY_DOWNSTREAM | GST_PAD_PROBE_TYPE_PUSH);
    gst_pad_add_probe(pad_of(element_.get(), "src").get(), kQueries, on_query, this, nullptr);
  }

  BufferPtr picture(uint32_t sequence, PixelFamily family = PixelFamily::kRgb) {
    request_and_answer(array_.request(sequence, sequence * kFrame), {0, 1, 2, 3}, 200, family);
    return BufferPtr(gst_harness_pull(harness_.get()));
  }

  void ask_and_answer() {
    ViewRequest asked = array_.request(0, 0);
    asked.view.pose.position.x += 0.03;
    request(asked);
    wire::Answer answer = answer_of(asked, {0, 1, 2}, 200, PixelFamily::kI420);
    for (Fragment& fragment : answer.fragments)
      for (size_t i = 0; i < fragment.pixels.size(); i++) fragment.pixels[i] ^= static_cast<uint8_t>(i * 5 % 16);
    push(0, answer);
  }

  // Returns the bytes of a picture with these downstream caps, without row padding; chroma as planes.
  std::vector<uint8_t> planar_with(const char* sink_caps) {
    nodes_.clear();
    start(1, {{"background", "0xff4080c0"}}, sink_caps);
    ask_and_answer();
    const BufferPtr picture(gst_harness_pull(harness_.get()));
    const CapsPtr caps(gst_pad_get_current_caps(harness_->sinkpad));
    EXPECT_TRUE(gst_video_info_from_caps(&info_, caps.get()));
    EXPECT_EQ(info_.colorimetry.matrix, GST_VIDEO_COLOR_MATRIX_BT601);
    GstVideoFrame frame;
    EXPECT_TRUE(gst_video_frame_map(&frame, &info_, picture.get(), GST_MAP_READ));
    std::vector<uint8_t> bytes;
    for (guint c = 0; c < 3; c++)
      for (gint y = 0; y < GST_VIDEO_FRAME_COMP_HEIGHT(&frame, c); y++)
        for (gint x = 0; x < GST_VIDEO_FRAME_COMP_WIDTH(&frame, c); x++)
          bytes.push_back(static_cast<const uint8_t*>(GST_VIDEO_FRAME_COMP_DATA(
              &frame, c))[y * GST_VIDEO_FRAME_COMP_STRIDE(&frame, c) + x * GST_VIDEO_FRAME_COMP_PSTRIDE(&frame, c)]);
    gst_video_frame_unmap(&frame);
    return bytes;
  }

  static GstPadProbeReturn on_query(GstPad*, GstPadProbeInfo* info, gpointer data) {
    auto* self = static_cast<LfCompositorDownstreamTest*>(data);
    GstQuery* query = GST_PAD_PROBE_INFO_QUERY(info);
    if (GST_QUERY_TYPE(query) != GST_QUERY_ALLOCATION) return GST_PAD_PROBE_OK;
    self->queries_++;
    if (self->fails_) return GST_PAD_PROBE_DROP;
    GstCaps* caps = nullptr;
    gst_query_parse_allocation(query, &caps, nullptr);
    GstVideoInfo info_of_caps;
    if (!caps || !gst_video_info_from_caps(&info_of_caps, caps)) return GST_PAD_PROBE_DROP;
    gst_query_add_allocation_pool(query, self->pool_, static_cast<guint>(info_of_caps.size), 0, self->most_);
    gst_query_add_allocation_meta(query, GST_VIDEO_META_API_TYPE, nullptr);
    return GST_PAD_PROBE_HANDLED;
  }

  GstBufferPool* pool_ = gst_video_buffer_pool_new();
  guint most_ = 0;
  bool fails_ = false;
  int queries_ = 0;
  GstVideoInfo info_{};  // of planar_with()
};

TEST_F(LfCompositorDownstreamTest, PicturesUseTheOfferedMemory) {
  start(1);
  answer_allocation();
  for (uint32_t i = 0; i < 20; i++) EXPECT_EQ(picture(i)->pool, pool_) << i;
  EXPECT_EQ(queries_, 1);
}

TEST_F(LfCompositorDownstreamTest, PicturesAreTheSameInAnyMemory) {
  start(1);
  const std::vector<uint8_t> plain = to_bytes(picture(0).get());
  nodes_.clear();
  start(1);
  answer_allocation();
  EXPECT_EQ(to_bytes(picture(0).get()), plain);
}

TEST_F(LfCompositorDownstreamTest, ExhaustedPoolDoesNotBlock) {
  start(1);
  most_ = 2;
  answer_allocation();
  std::vector<BufferPtr> kept;
  for (uint32_t i = 0; i < 8; i++) kept.push_back(picture(i));
  EXPECT_EQ(std::ranges::count_if(kept, [&](const BufferPtr& b) { return b->pool == pool_; }), 2);
}

TEST_F(LfCompositorDownstreamTest, WorksWithoutADownstreamPool) {
  start(1);
  fails_ = true;
  answer_allocation();
  for (uint32_t i = 0; i < 5; i++) EXPECT_NE(picture(i), nullptr);
  EXPECT_EQ(queries_, 1);
}

TEST_F(LfCompositorDownstreamTest, DownstreamChangesAreRenegotiated) {
  start(1);
  fails_ = true;
  answer_allocation();
  EXPECT_NE(picture(0)->pool, pool_);
  fails_ = false;
  gst_harness_push_upstream_event(harness_.get(), gst_event_new_reconfigure());
  EXPECT_EQ(picture(1)->pool, pool_);
  gst_harness_push_upstream_event(harness_.get(), gst_event_new_reconfigure());
  EXPECT_EQ(picture(2)->pool, pool_) << "the same pool, which is in use";
  EXPECT_EQ(queries_, 3);
}

TEST_F(LfCompositorDownstreamTest, NextRunNegotiatesAgain) {
  start(1);
  answer_allocation();
  EXPECT_EQ(picture(0)->pool, pool_);
  EXPECT_TRUE(gst_buffer_pool_is_active(pool_));
  gst_element_set_state(element_.get(), GST_STATE_NULL);
  EXPECT_FALSE(gst_buffer_pool_is_active(pool_));
}

TEST_F(LfCompositorDownstreamTest, PartialAnswersHaveTheirOwnCapsAndMemory) {
  start(1, {{"rig", array_.rig_path()}, {"partial", "true"}});
  answer_allocation();
  const BufferPtr answer = picture(0);
  EXPECT_EQ(answer->pool, nullptr);
  EXPECT_EQ(caps_of(harness_->sinkpad), "application/x-lightfield-answer, parsed=(boolean)true");
}

TEST_F(LfCompositorDownstreamTest, Nv12IsI420InAnotherLayout) {
  std::vector<uint8_t> pictures[2];
  for (const bool nv12 : {false, true}) {
    pictures[nv12] = planar_with(nv12 ? "video/x-raw,format=NV12" : "video/x-raw,format=I420");
    EXPECT_EQ(output_format(), nv12 ? "NV12" : "I420");
    EXPECT_EQ(info_.colorimetry.range, GST_VIDEO_COLOR_RANGE_0_255);
  }
  EXPECT_EQ(pictures[0], pictures[1]);
  EXPECT_NE(std::ranges::min(pictures[0]), std::ranges::max(pictures[0]));
}

TEST_F(LfCompositorDownstreamTest, VideoHasTheRequestedRange) {
  std::vector<uint8_t> pictures[2];
  for (const bool video : {false, true}) {
    pictures[video] = planar_with(video ? "video/x-raw,format=I420,colorimetry=bt601; video/x-raw" : "video/x-raw");
    EXPECT_EQ(info_.colorimetry.range, video ? GST_VIDEO_COLOR_RANGE_16_235 : GST_VIDEO_COLOR_RANGE_0_255);
  }
  const size_t luma = pictures[0].size() / 3 * 2;
  ASSERT_EQ(pictures[0].size(), pictures[1].size());
  for (size_t i = 0; i < pictures[0].size(); i++) {
    const int full = pictures[0][i];
    ASSERT_NEAR(pictures[1][i], i < luma ? 16 + full * 219 / 255. : 128 + (full - 128) * 224 / 255., 0.95) << i;
  }
}

TEST_F(LfCompositorDownstreamTest, PlanesArePreferred) {
  start(1, {}, "video/x-raw,format={ NV12, I420 }");
  EXPECT_NE(picture(0, PixelFamily::kI420), nullptr);
  EXPECT_EQ(output_format(), "I420");
}

// QoS events report late pictures.

GstEvent* late_by(GstClockTimeDiff diff, GstClockTime timestamp) {
  return gst_event_new_qos(GST_QOS_TYPE_UNDERFLOW, 2, diff, timestamp);
}

class LfCompositorQosTest : public LfCompositorTest {
 protected:
  void start_two_frames_late(GstClockTime timestamp) {
    start(1, {{"view-id", "3"}});
    bus_.emplace(element_.get());
    gst_harness_query_latency(harness_.get());
    push_upstream(late_by(2 * kFrame, timestamp));
  }
  void push_upstream(GstEvent* event) { gst_harness_push_upstream_event(harness_.get(), event); }
  void one(uint32_t sequence) { request_and_answer(array_.request(sequence, sequence * kFrame, 3), {0, 1, 2, 3}); }
  std::optional<ElementBus> bus_;
};

TEST_F(LfCompositorQosTest, LatePicturesAreSkippedAndReported) {
  start_two_frames_late(kFrame);  // skips four frames to catch up: the harness is not live
  for (uint32_t i = 2; i <= 5; i++) one(i);
  pull();
  EXPECT_EQ(last_pts_, 5 * kFrame);
  EXPECT_EQ(stat(element_.get(), "skipped"), 3u);
  EXPECT_EQ(stat(element_.get(), "pictures"), 1u);
  EXPECT_EQ(stat(element_.get(), "incomplete"), 0u);
  EXPECT_EQ(stat(element_.get(), "late-answers"), 0u);
  for (uint64_t i = 2; i < 5; i++) {
    const MessagePtr message(gst_bus_pop_filtered(bus_->get(), GST_MESSAGE_QOS));
    ASSERT_TRUE(message);
    gboolean live = TRUE;
    guint64 running = 0, stream = 0, pts = 0, duration = 0, processed = 0, dropped = 0;
    gint64 jitter = 0;
    gdouble proportion = 0;
    GstFormat format{};
    gst_message_parse_qos(message.get(), &live, &running, &stream, &pts, &duration);
    gst_message_parse_qos_values(message.get(), &jitter, &proportion, nullptr);
    gst_message_parse_qos_stats(message.get(), &format, &processed, &dropped);
    EXPECT_FALSE(live);
    EXPECT_EQ(running, i * kFrame);
    EXPECT_EQ(pts, i * kFrame);
    EXPECT_EQ(duration, kFrame);
    EXPECT_EQ(jitter, static_cast<gint64>((5 - i) * kFrame));
    EXPECT_EQ(proportion, 2);
    EXPECT_EQ(format, GST_FORMAT_BUFFERS);
    EXPECT_EQ(processed, 0u);
    EXPECT_EQ(dropped, i - 1);
  }
}

// The nodes may have skipped this request already, so no picture is shown.
TEST_F(LfCompositorQosTest, CurrentRequestIsSkipped) {
  start(2, {{"view-id", "3"}});
  const ViewRequest first = array_.request(1, kFrame, 3), second = array_.request(3, 3 * kFrame, 3);
  request_and_answer(first, {0, 1});
  push_upstream(late_by(kFrame, kFrame));
  push(1, answer_of(first, {}));
  request_and_answer(second, {0, 1});
  push(1, answer_of(second, {2, 3}));
  pull();
  EXPECT_EQ(last_pts_, 3 * kFrame);
  EXPECT_EQ(stat(element_.get(), "skipped"), 1u);
  EXPECT_EQ(stat(element_.get(), "incomplete"), 0u);
}

TEST_F(LfCompositorQosTest, QosEventsNameTheView) {
  start(1, {{"view-id", "3"}});
  one(0);  // GstAggregator forwards events only to pads that have buffers
  pull();
  push_upstream(late_by(kFrame, 0));
  std::optional<guint> view_id;
  while (const EventPtr event{gst_harness_try_pull_upstream_event(nodes_[0].get())}) {
    guint of = 0;
    if (GST_EVENT_TYPE(event.get()) == GST_EVENT_QOS &&
        gst_structure_get_uint(gst_event_get_structure(event.get()), "lightfield-view-id", &of))
      view_id = of;
  }
  EXPECT_EQ(view_id, 3u);
}

TEST_F(LfCompositorQosTest, QosOfOtherViewsIsIgnored) {
  start(1, {{"view-id", "3"}});
  GstEvent* other = late_by(20 * kFrame, 0);
  gst_structure_set(gst_event_writable_structure(other), "lightfield-view-id", G_TYPE_UINT, 4u, nullptr);
  push_upstream(other);
  one(1);
  pull();
  EXPECT_EQ(last_pts_, kFrame);
}

TEST_F(LfCompositorQosTest, FlushClearsQos) {
  start_two_frames_late(kFrame);
  for (GstHarness* harness : {harness_.get(), nodes_[0].get()})
    gst_harness_push_event(harness, gst_event_new_flush_start());
  for (GstHarness* harness : {harness_.get(), nodes_[0].get()}) {
    gst_harness_push_event(harness, gst_event_new_flush_stop(TRUE));
    push_segment(harness);
  }
  one(1);
  one(9);
  pull();
  EXPECT_EQ(last_pts_, kFrame);
}

// Runs from the sink to the nodes; showing a picture takes five frame intervals.
TEST(Qos, SlowSinkReducesTheWorkOfCameras) {
  const ArrayFixture array;
  const std::string rig = " rig=" + array.rig_path();
  const PipelinePtr pipeline = launch("lfviewrequest num-buffers=60 framerate=50/1" + rig +
                                      " ! tee name=r  r. ! queue ! n.request  lfcameranode name=n" + rig +
                                      " ! c.sink_0  r. ! queue ! c.request  lfcompositor name=c" + rig +
                                      " ! identity sleep-time=100000 ! fakesink sync=true qos=true");
  const ElementPtr node = child_of(pipeline.get(), "n"), compositor = child_of(pipeline.get(), "c");
  EXPECT_EQ(run(pipeline.get(), 60), "");
  EXPECT_GT(stat(node.get(), "skipped"), 10u);
  EXPECT_GT(stat(compositor.get(), "skipped"), 10u);
  EXPECT_GT(stat(compositor.get(), "pictures"), 2u);
  EXPECT_EQ(stat(compositor.get(), "pictures") + stat(compositor.get(), "skipped"), 60u);
  EXPECT_EQ(stat(compositor.get(), "incomplete"), 0u);
}

}  // namespace
}  // namespace lf::test
