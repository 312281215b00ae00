// SPDX-License-Identifier: LGPL-2.1-or-later
#include <gmock/gmock.h>
#include <gst/check/gsttestclock.h>

#include <thread>

#include "gst/rtp_fixture.h"
#include "lib/wire/wire_test.h"

namespace lf::test {
namespace {

using testing::HasSubstr;

TEST(RtpLfPay, PacketsOfAnAnswer) {
  for (const int mtu : {300, 1400, 9000}) {
    RtpElement pay(("rtplfpay pt=97 mtu=" + std::to_string(mtu)).c_str(), kAnswerCaps);
    const Bytes units[] = {rtp::answer(60, 40, 30, 90), rtp::answer(1, 300, 300, 90), rtp::answer(0, 1, 1, 0),
                           rtp::answer_with_sum(200, 100, true)};
    std::vector<RtpPacket> last;
    for (int i = 0; i < 4; i++) {
      ASSERT_EQ(pay.push(units[i], i * 40 * GST_MSECOND), GST_FLOW_OK);
      std::vector<RtpPacket> packets = pay.packets();
      ASSERT_FALSE(packets.empty());
      for (size_t p = 0; p < packets.size(); p++) {
        EXPECT_LE(packets[p].bytes.size(), static_cast<size_t>(mtu));
        EXPECT_EQ(packets[p].payload_type, 97);
        EXPECT_EQ(packets[p].timestamp, packets[0].timestamp);
        EXPECT_EQ(packets[p].marker, p + 1 == packets.size());
        EXPECT_EQ(packets[p].time, i * 40 * GST_MSECOND);
        EXPECT_EQ(packets[p].sequence, static_cast<uint16_t>(packets[0].sequence + p));
      }
      if (!last.empty()) {
        EXPECT_EQ(packets[0].timestamp - last[0].timestamp, 3600u);
        EXPECT_EQ(packets[0].sequence, static_cast<uint16_t>(last.back().sequence + 1));
      }
      last = std::move(packets);
    }
    EXPECT_EQ(stat(pay.element(), "units"), 4u);
    EXPECT_GT(stat(pay.element(), "packets"), 9u);
    EXPECT_GT(stat(pay.element(), "bytes"), 10000u);
    EXPECT_GT(stat(pay.element(), "chunks"), 0u);
    EXPECT_GT(stat(pay.element(), "tiles"), 0u);
  }
}

TEST(RtpLfPay, Caps) {
  RtpElement answers("rtplfpay", kAnswerCaps);
  answers.push(rtp::answer(1, 10, 10, 0));
  EXPECT_THAT(answers.caps(), HasSubstr("media=(string)application, clock-rate=(int)90000, "
                                        "encoding-name=(string)X-LIGHTFIELD-ANSWER, payload=(int)96"));
  RtpElement requests("rtplfpay", kRequestCaps);
  requests.push(rtp::request(1));
  EXPECT_THAT(requests.caps(), HasSubstr("X-LIGHTFIELD-REQUEST"));
  EXPECT_THAT(requests.caps(), HasSubstr("framerate=(string)30/1"));
  RtpElement variable("rtplfpay", "application/x-lightfield-request, framerate=(fraction)0/1");
  variable.push(rtp::request(1));
  EXPECT_THAT(variable.caps(), testing::Not(HasSubstr("framerate")));
}

TEST(RtpLfPay, EveryPayloadTypeThatIsOfferedIsUsed) {
  for (const int type : {0, 50, 95, 96, 127}) {
    RtpElement pay(("rtplfpay pt=" + std::to_string(type)).c_str(), kAnswerCaps);
    pay.push(rtp::answer(1, 10, 10, 0));
    EXPECT_THAT(pay.caps(), HasSubstr("payload=(int)" + std::to_string(type)));
    const std::vector<RtpPacket> packets = pay.packets();
    ASSERT_FALSE(packets.empty());
    EXPECT_EQ(packets[0].payload_type, type);
  }
}

// Limits of streams that may be cut at any time.
TEST(RtpLfPay, LimitsOfTimeCanNotBeSet) {
  RtpElement pay("rtplfpay", kAnswerCaps);
  using Limit = std::pair<const char*, gint64>;
  for (const auto& [name, value] : {Limit{"min-ptime", 0}, Limit{"max-ptime", -1}, Limit{"ptime-multiple", 0}}) {
    GParamSpec* spec = g_object_class_find_property(G_OBJECT_GET_CLASS(pay.element()), name);
    ASSERT_TRUE(spec) << name;
    EXPECT_FALSE(spec->flags & G_PARAM_WRITABLE) << name;
    gint64 now = 77;
    g_object_get(pay.element(), name, &now, nullptr);
    EXPECT_EQ(now, value) << name;
  }
}

TEST(RtpLfPay, StatsHaveThoseOfEveryPayloader) {
  RtpElement pay("rtplfpay ssrc=77", kAnswerCaps);
  pay.push(rtp::answer(1, 10, 10, 0));
  GstStructure* stats = nullptr;
  g_object_get(pay.element(), "stats", &stats, nullptr);
  const StructurePtr owner(stats);
  guint ssrc = 0, clock_rate = 0;
  EXPECT_TRUE(gst_structure_get(stats, "ssrc", G_TYPE_UINT, &ssrc, "clock-rate", G_TYPE_UINT, &clock_rate, nullptr));
  EXPECT_EQ(ssrc, 77u);
  EXPECT_EQ(clock_rate, 90000u);
}

TEST(RtpLfPay, DropsWhatIsNoUnit) {
  RtpElement pay("rtplfpay", kAnswerCaps);
  const Bytes good = rtp::answer(1, 20, 20, 0);
  for (const Bytes& bad :
       {Bytes{}, Bytes(100, 'x'), rtp::request(1), Bytes(good.begin(), good.end() - 1), wire::with(good, 48, 2, 0)})
    EXPECT_EQ(pay.push(bad), GST_FLOW_OK);
  EXPECT_TRUE(pay.packets().empty());
  EXPECT_EQ(stat(pay.element(), "dropped"), 5u);
  EXPECT_EQ(pay.push(good), GST_FLOW_OK);
  EXPECT_EQ(pay.packets().size(), 1u);
}

TEST(RtpLfPay, TooSmallAnMtuIsAnError) {
  RtpElement pay("rtplfpay mtu=200", kAnswerCaps);
  GstBus* bus = gst_bus_new();
  gst_element_set_bus(pay.element(), bus);
  EXPECT_EQ(pay.push(rtp::answer(1, 10, 10, 0)), GST_FLOW_ERROR);
  GstMessage* message = gst_bus_pop_filtered(bus, GST_MESSAGE_ERROR);
  ASSERT_TRUE(message);
  GError* error = nullptr;
  gchar* debug = nullptr;
  gst_message_parse_error(message, &error, &debug);
  EXPECT_THAT(error->message, HasSubstr("200"));
  EXPECT_THAT(debug, HasSubstr("set mtu to 268 or more"));
  g_clear_error(&error);
  g_free(debug);
  gst_message_unref(message);
  gst_element_set_bus(pay.element(), nullptr);
  gst_object_unref(bus);
  RtpElement smallest("rtplfpay mtu=268", kAnswerCaps);
  EXPECT_EQ(smallest.push(rtp::answer(3, 30, 30, 50)), GST_FLOW_OK);
}

TEST(RtpLfPay, RequestsAreRepeatedUntilAFlush) {
  RtpElement pay("rtplfpay", kRequestCaps);
  const size_t one = rtp::request(0).size();
  const auto bytes = [&] {
    const std::vector<RtpPacket> packets = pay.packets();
    EXPECT_EQ(packets.size(), 1u);
    EXPECT_TRUE(packets[0].marker);
    return packets[0].bytes.size() - 12 - rtp::kUnitsHeaderBytes;
  };
  for (size_t i = 0; i < 5; i++) {
    pay.push(rtp::request(static_cast<uint32_t>(i)), i * GST_MSECOND);
    EXPECT_EQ(bytes(), std::min<size_t>(i + 1, 3) * one);
  }
  gst_harness_push_event(pay.h(), gst_event_new_flush_start());
  gst_harness_push_event(pay.h(), gst_event_new_flush_stop(TRUE));
  GstSegment segment;
  gst_segment_init(&segment, GST_FORMAT_TIME);
  gst_harness_push_event(pay.h(), gst_event_new_segment(&segment));
  pay.push(rtp::request(9));
  EXPECT_EQ(bytes(), one);
}

TEST(RtpLfPay, IsALink) {
  EXPECT_TRUE(passes_in_process_query("queue", kAnswerCaps));
  EXPECT_FALSE(passes_in_process_query("rtplfpay", kAnswerCaps));
}

TEST(RtpLfPay, PacesBursts) {
  RtpElement pay("rtplfpay max-bitrate=8000000", kAnswerCaps);
  gst_harness_use_testclock(pay.h());
  GstTestClock* clock = gst_harness_get_testclock(pay.h());
  gst_harness_play(pay.h());
  const Bytes unit = rtp::answer(1, 390, 390, 95);
  std::thread pushing([&] { EXPECT_EQ(pay.push(unit), GST_FLOW_OK); });
  // Eight packets at once, and the next ones when those have had their time.
  guint received = 8;
  for (; received < unit.size() / 1388; received += 8) {
    GstClockID id = nullptr;
    gst_test_clock_wait_for_next_pending_id(clock, &id);
    EXPECT_EQ(gst_harness_buffers_received(pay.h()), received);
    const GstClockTime wait = gst_clock_id_get_time(id) - gst_clock_get_time(GST_CLOCK(clock));
    EXPECT_GT(wait, 10 * GST_MSECOND);  // of 1400 bytes at most
    EXPECT_LE(wait, 8 * 1400 * GST_USECOND);
    gst_clock_id_unref(id);
    EXPECT_TRUE(gst_test_clock_crank(clock));
  }
  pushing.join();
  EXPECT_GT(received, 8u);
  EXPECT_GT(gst_harness_buffers_received(pay.h()), received - 8);
  gst_object_unref(clock);
}

TEST(RtpLfPay, FlushesAndStopsWhilePacing) {
  for (const bool stop : {false, true}) {
    RtpElement pay("rtplfpay max-bitrate=8000", kAnswerCaps);
    gst_harness_use_testclock(pay.h());
    GstTestClock* clock = gst_harness_get_testclock(pay.h());
    gst_harness_play(pay.h());
    std::thread pushing([&] { EXPECT_EQ(pay.push(rtp::answer(1, 390, 390, 95)), GST_FLOW_FLUSHING); });
    gst_test_clock_wait_for_next_pending_id(clock, nullptr);
    if (stop)
      gst_element_set_state(pay.element(), GST_STATE_NULL);
    else
      gst_harness_push_event(pay.h(), gst_event_new_flush_start());
    pushing.join();
    gst_object_unref(clock);
  }
}

}  // namespace
}  // namespace lf::test
