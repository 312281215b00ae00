// SPDX-License-Identifier: LGPL-2.1-or-later
#include <gst/check/gsttestclock.h>

#include "gst/rtp_fixture.h"

namespace lf::test {
namespace {

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
  EXPECT_THAT(requests.caps(), AllOf(HasSubstr("X-LIGHTFIELD-REQUEST"), HasSubstr("framerate=(string)30/1")));
  RtpElement variable("rtplfpay", "application/x-lightfield-request, framerate=(fraction)0/1");
  variable.push(rtp::request(1));
  EXPECT_THAT(variable.caps(), Not(HasSubstr("framerate")));
}

TEST(RtpLfPay, AcceptsEveryOfferedPayloadType) {
  for (const int type : {0, 50, 95, 96, 127}) {
    RtpElement pay(("rtplfpay pt=" + std::to_string(type)).c_str(), kAnswerCaps);
    pay.push(rtp::answer(1, 10, 10, 0));
    EXPECT_THAT(pay.caps(), HasSubstr("payload=(int)" + std::to_string(type)));
    const std::vector<RtpPacket> packets = pay.packets();
    ASSERT_FALSE(packets.empty());
    EXPECT_EQ(packets[0].payload_type, type);
  }
}

// Streams may be cut at any time.
TEST(RtpLfPay, TimeLimitsAreReadOnly) {
  RtpElement pay("rtplfpay", kAnswerCaps);
  using Limit = std::pair<const char*, gint64>;
  for (const auto& [name, value] : {Limit{"min-ptime", 0}, Limit{"max-ptime", -1}, Limit{"ptime-multiple", 0}}) {
    GParamSpec* spec = g_object_class_find_property(G_OBJECT_GET_CLASS(pay.element()), name);
    ASSERT_TRUE(spec) << name;
    EXPECT_FALSE(spec->flags & G_PARAM_WRITABLE) << name;
    EXPECT_EQ(get<gint64>(pay.element(), name), value) << name;
  }
}

TEST(RtpLfPay, StatsIncludeTheBaseClass) {
  RtpElement pay("rtplfpay ssrc=77", kAnswerCaps);
  pay.push(rtp::answer(1, 10, 10, 0));
  const StructurePtr stats = stats_of(pay.element());
  guint ssrc = 0, clock_rate = 0;
  EXPECT_TRUE(
      gst_structure_get(stats.get(), "ssrc", G_TYPE_UINT, &ssrc, "clock-rate", G_TYPE_UINT, &clock_rate, nullptr));
  EXPECT_EQ(ssrc, 77u);
  EXPECT_EQ(clock_rate, 90000u);
}

TEST(RtpLfPay, DropsInvalidUnits) {
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

TEST(RtpLfPay, TooSmallMtuIsAnError) {
  RtpElement pay("rtplfpay mtu=200", kAnswerCaps);
  const ElementBus bus(pay.element());
  EXPECT_EQ(pay.push(rtp::answer(1, 10, 10, 0)), GST_FLOW_ERROR);
  const MessagePtr message(gst_bus_pop_filtered(bus.get(), GST_MESSAGE_ERROR));
  ASSERT_TRUE(message);
  g_autoptr(GError) error = nullptr;
  g_autofree gchar* debug = nullptr;
  gst_message_parse_error(message.get(), &error, &debug);
  EXPECT_THAT(error->message, HasSubstr("200"));
  EXPECT_THAT(debug, mentions("mtu", "268"));
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
  flush(pay.h());
  pay.push(rtp::request(9));
  EXPECT_EQ(bytes(), one);
}

TEST(RtpLfPay, CountsAsALink) {
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
  // Eight packets at once; the next ones leave when those have been sent at the pacing rate.
  guint received = 8;
  for (; received < unit.size() / 1388; received += 8) {
    GstClockID id = nullptr;
    gst_test_clock_wait_for_next_pending_id(clock, &id);
    EXPECT_EQ(gst_harness_buffers_received(pay.h()), received);
    const GstClockTime wait = gst_clock_id_get_time(id) - gst_clock_get_time(GST_CLOCK(clock));
    EXPECT_GT(wait, 10 * GST_MSECOND);  // at most 1400 bytes each
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
    g_autoptr(GstTestClock) clock = gst_harness_get_testclock(pay.h());
    gst_harness_play(pay.h());
    std::thread pushing([&] { EXPECT_EQ(pay.push(rtp::answer(1, 390, 390, 95)), GST_FLOW_FLUSHING); });
    gst_test_clock_wait_for_next_pending_id(clock, nullptr);
    if (stop)
      gst_element_set_state(pay.element(), GST_STATE_NULL);
    else
      gst_harness_push_event(pay.h(), gst_event_new_flush_start());
    pushing.join();
  }
}

std::vector<Bytes> rtp_packets(const std::vector<Bytes>& units, bool requests = false, uint16_t first = 65530) {
  RtpElement pay(("rtplfpay ssrc=1 timestamp-offset=5 seqnum-offset=" + std::to_string(first)).c_str(),
                 requests ? kRequestCaps : kAnswerCaps);
  for (size_t i = 0; i < units.size(); i++) EXPECT_EQ(pay.push(units[i], i * 40 * GST_MSECOND), GST_FLOW_OK);
  std::vector<Bytes> out;
  for (const RtpPacket& packet : pay.packets()) out.push_back(packet.bytes);
  return out;
}

size_t fragments_in(const std::vector<Bytes>& units) {
  std::vector<std::pair<uint32_t, uint32_t>> all;
  for (const Bytes& unit : units) {
    std::string reason;
    const std::optional<wire::AnswerView> part = wire::parse_answer(unit, &reason);
    EXPECT_TRUE(part.has_value()) << reason;
    if (!part) continue;
    for (uint32_t i = 0; i < part->part.count; i++) all.emplace_back(part->sequence, part->part.first + i);
  }
  std::ranges::sort(all);
  EXPECT_EQ(std::ranges::adjacent_find(all), all.end());
  return all.size();
}

TEST(RtpLfDepay, ReceivesSentUnits) {
  const std::vector<Bytes> answers{rtp::answer(5, 20, 20, 80), rtp::answer(1, 390, 390, 90), rtp::answer(0, 1, 1, 0)};
  RtpElement depay("rtplfdepay", kRtpAnswerCaps);
  std::vector<Bytes> packets = rtp_packets(answers);
  for (size_t i = 0; i < packets.size(); i++) EXPECT_EQ(depay.push(packets[i], i), GST_FLOW_OK);
  EXPECT_EQ(depay.units(), answers);
  EXPECT_EQ(depay.times, (std::vector<GstClockTime>{0, packets.size() - 2, packets.size() - 1}));
  EXPECT_EQ(depay.caps(), "application/x-lightfield-answer, parsed=(boolean)true");
  EXPECT_EQ(stat(depay.element(), "units"), 3u);
  EXPECT_EQ(stat(depay.element(), "packets"), packets.size());
  EXPECT_EQ(stat(depay.element(), "lost"), 0u);

  RtpElement requests("rtplfdepay", (std::string(kRtpRequestCaps) + ", framerate=(string)25/2").c_str());
  const std::vector<Bytes> three{rtp::request(1), rtp::request(2), rtp::request(3)};
  for (const Bytes& packet : rtp_packets(three, true)) requests.push(packet);
  EXPECT_EQ(requests.units(), three);
  EXPECT_EQ(requests.caps(), "application/x-lightfield-request, parsed=(boolean)true, framerate=(fraction)25/2");
  EXPECT_EQ(stat(requests.element(), "repeated"), 3u);
  for (const char* rate : {"", ", framerate=(string)many"}) {
    RtpElement variable("rtplfdepay", (std::string(kRtpRequestCaps) + rate).c_str());
    variable.push(rtp_packets(three, true)[0]);
    EXPECT_EQ(variable.caps(), "application/x-lightfield-request, parsed=(boolean)true, framerate=(fraction)0/1");
  }
}

TEST(RtpLfDepay, ToleratesReorderingAndDuplicates) {
  std::mt19937 random(2);
  std::vector<Bytes> packets = rtp_packets({rtp::answer_with_sum(200, 120, true, 20)});
  const size_t n = packets.size();
  for (size_t i = 0; i < n; i++) packets.push_back(packets[i]);
  std::ranges::shuffle(packets, random);
  RtpElement depay("rtplfdepay", kRtpAnswerCaps);
  for (const Bytes& packet : packets) EXPECT_EQ(depay.push(packet), GST_FLOW_OK);
  const std::vector<Bytes> units = depay.units();
  ASSERT_FALSE(units.empty());
  EXPECT_EQ(fragments_in(units), wire::parse_answer_header(units[0]).value().part.total);
  EXPECT_EQ(stat(depay.element(), "duplicates"), n);
  EXPECT_EQ(stat(depay.element(), "lost"), 0u);
}

TEST(RtpLfDepay, ToleratesTwoLostRequestPackets) {
  std::vector<Bytes> requests;
  for (uint32_t i = 0; i < 12; i++) requests.push_back(rtp::request(i));
  const std::vector<Bytes> packets = rtp_packets(requests, true);
  RtpElement depay("rtplfdepay", kRtpRequestCaps);
  for (size_t i = 0; i < packets.size(); i++)
    if (i % 3 == 2) depay.push(packets[i]);
  EXPECT_EQ(depay.units(), requests);
  EXPECT_EQ(stat(depay.element(), "lost"), 6u);
}

TEST(RtpLfDepay, AcceptsBufferLists) {
  RtpElement depay("rtplfdepay", kRtpAnswerCaps);
  GstBufferList* list = gst_buffer_list_new();
  for (const Bytes& packet : rtp_packets({rtp::answer(60, 40, 30, 90)})) gst_buffer_list_add(list, to_buffer(packet));
  gst_buffer_list_add(list, to_buffer({1, 2, 3}));
  EXPECT_EQ(gst_pad_push_list(depay.h()->srcpad, list), GST_FLOW_OK);
  EXPECT_EQ(fragments_in(depay.units()), 60u);
  EXPECT_EQ(stat(depay.element(), "bad-rtp"), 1u);
}

TEST(RtpLfDepay, ForeignPacketsAreCountedAndReportedOnce) {
  RtpElement depay("rtplfdepay", kRtpAnswerCaps);
  const ElementBus bus(depay.element());
  std::mt19937 random(1);
  Bytes good = rtp_packets({rtp::answer(1, 20, 20, 0)})[0];
  for (int i = 0; i < 2000; i++) {
    Bytes bytes = good;
    if (i % 2)
      for (uint8_t& byte : bytes) byte = static_cast<uint8_t>(random());
    bytes.resize(random() % bytes.size());
    EXPECT_EQ(depay.push(bytes), GST_FLOW_OK);
  }
  EXPECT_TRUE(depay.units().empty());
  EXPECT_GT(stat(depay.element(), "bad-rtp"), 500u);
  EXPECT_GT(stat(depay.element(), "bad-units") + stat(depay.element(), "duplicates"), 500u);
  const MessagePtr told(gst_bus_pop(bus.get()));
  ASSERT_TRUE(told);
  EXPECT_EQ(GST_MESSAGE_TYPE(told.get()), GST_MESSAGE_WARNING);
  EXPECT_FALSE(gst_bus_have_pending(bus.get()));
}

TEST(RtpLfDepay, MalformedHeaderExtensionsDoNotHangIt) {
  std::string caps = kRtpAnswerCaps;
  caps += ", extmap-1=(string)urn:ietf:params:rtp-hdrext:ntp-64";
  RtpElement depay("rtplfdepay", caps.c_str());
  const Bytes unit = rtp::answer(1, 20, 20, 0);
  const Bytes packet = rtp_packets({unit})[0];
  const Bytes extensions[] = {{0xbe, 0xde, 0, 1, 0x1f, 0, 0, 0},
                              {0xbe, 0xde, 0, 2, 0x10, 0, 0, 0, 0, 0, 0x1f, 0xff},
                              {0x10, 0, 0, 1, 1, 0xff, 0, 0}};
  uint16_t sequence = 1;
  for (const Bytes& extension : extensions) {
    Bytes bytes = packet;
    bytes[0] |= 0x10;
    bytes[2] = 0;
    bytes[3] = static_cast<uint8_t>(sequence++);
    bytes.insert(bytes.begin() + 12, extension.begin(), extension.end());
    EXPECT_EQ(depay.push(bytes), GST_FLOW_OK);
    EXPECT_EQ(depay.units(), std::vector<Bytes>{unit});
  }
}

TEST(RtpLfDepay, IgnoresJitterbufferEvents) {
  RtpElement depay("rtplfdepay", kRtpAnswerCaps);
  const std::vector<Bytes> packets = rtp_packets({rtp::answer_with_sum(100, 100, false)});
  depay.push(packets[0]);
  while (EventPtr(gst_harness_try_pull_event(depay.h()))) continue;
  GstStructure* lost = gst_structure_from_string(
      "GstRTPPacketLost,seqnum=(uint)65531,timestamp=(guint64)0,duration=(guint64)0,retry=(uint)0", nullptr);
  gst_harness_push_event(depay.h(), gst_event_new_custom(GST_EVENT_CUSTOM_DOWNSTREAM, lost));
  EXPECT_FALSE(gst_harness_try_pull_event(depay.h()));
  depay.push(packets[2]);
  EXPECT_EQ(depay.units().size(), 2u);
  EXPECT_EQ(stat(depay.element(), "lost"), 1u);
}

TEST(RtpLfDepay, IncompleteUnitsEndWithTheStream) {
  const std::vector<Bytes> packets = rtp_packets({rtp::answer(1, 390, 390, 90)});
  for (const bool flushes : {false, true}) {
    RtpElement depay("rtplfdepay", kRtpAnswerCaps);
    depay.push(packets[0]);
    depay.push(packets[1]);
    if (flushes) {
      flush(depay.h());
      for (const Bytes& packet : packets) depay.push(packet);
      EXPECT_EQ(depay.units().size(), 1u);
      EXPECT_EQ(stat(depay.element(), "duplicates"), 0u);
    } else {
      gst_harness_push_event(depay.h(), gst_event_new_eos());
    }
    EXPECT_EQ(stat(depay.element(), "incomplete-units"), 1u);
  }
}

TEST(RtpLfDepay, PendingBytesAreBounded) {
  RtpElement depay("rtplfdepay max-size-bytes=65536", kRtpAnswerCaps);
  std::vector<Bytes> answers(6, rtp::answer(1, 399, 399, 95));
  std::vector<Bytes> packets = rtp_packets(answers);
  ASSERT_GT(answers[0].size(), 15000u);
  std::erase_if(packets, [](const Bytes& packet) { return packet[1] & 0x80; });
  for (const Bytes& packet : packets) depay.push(packet);
  EXPECT_TRUE(depay.units().empty());
  EXPECT_GE(stat(depay.element(), "incomplete-units"), 1u);
}

TEST(RtpLfDepay, CountsAsALink) { EXPECT_FALSE(passes_in_process_query("rtplfdepay", kRtpAnswerCaps)); }

TEST(RtpLfDepay, StatsIncludeTheBaseClass) {
  RtpElement depay("rtplfdepay", kRtpAnswerCaps);
  depay.push(rtp_packets({rtp::answer(1, 10, 10, 0)}, false, 1234)[0]);
  guint seqnum = 0;
  EXPECT_TRUE(gst_structure_get_uint(stats_of(depay.element()).get(), "seqnum", &seqnum));
  EXPECT_EQ(seqnum, 1234u);
}

}  // namespace
}  // namespace lf::test
