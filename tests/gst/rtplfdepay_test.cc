// SPDX-License-Identifier: LGPL-2.1-or-later
#include <gmock/gmock.h>

#include <algorithm>
#include <random>

#include "gst/rtp_fixture.h"

namespace lf::test {
namespace {

// What rtplfpay makes of units, 40 ms apart.
std::vector<Bytes> rtp_packets(const std::vector<Bytes>& units, bool requests = false, uint16_t first = 65530) {
  RtpElement pay(("rtplfpay ssrc=1 timestamp-offset=5 seqnum-offset=" + std::to_string(first)).c_str(),
                 requests ? kRequestCaps : kAnswerCaps);
  for (size_t i = 0; i < units.size(); i++) EXPECT_EQ(pay.push(units[i], i * 40 * GST_MSECOND), GST_FLOW_OK);
  std::vector<Bytes> out;
  for (const RtpPacket& packet : pay.packets()) out.push_back(packet.bytes);
  return out;
}

// The fragments in some units, and whether none came twice.
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

TEST(RtpLfDepay, WhatWasSentComes) {
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

TEST(RtpLfDepay, OrderDoesNotMatterAndDuplicatesNeither) {
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

TEST(RtpLfDepay, TwoLostRequestPacketsCostNothing) {
  std::vector<Bytes> requests;
  for (uint32_t i = 0; i < 12; i++) requests.push_back(rtp::request(i));
  const std::vector<Bytes> packets = rtp_packets(requests, true);
  RtpElement depay("rtplfdepay", kRtpRequestCaps);
  for (size_t i = 0; i < packets.size(); i++)
    if (i % 3 == 2) depay.push(packets[i]);
  EXPECT_EQ(depay.units(), requests);
  EXPECT_EQ(stat(depay.element(), "lost"), 6u);
}

TEST(RtpLfDepay, BufferListsAreTaken) {
  RtpElement depay("rtplfdepay", kRtpAnswerCaps);
  GstBufferList* list = gst_buffer_list_new();
  for (const Bytes& packet : rtp_packets({rtp::answer(60, 40, 30, 90)})) gst_buffer_list_add(list, to_buffer(packet));
  gst_buffer_list_add(list, to_buffer({1, 2, 3}));
  EXPECT_EQ(gst_pad_push_list(depay.h()->srcpad, list), GST_FLOW_OK);
  EXPECT_EQ(fragments_in(depay.units()), 60u);
  EXPECT_EQ(stat(depay.element(), "bad-rtp"), 1u);
}

TEST(RtpLfDepay, WhatIsNoneOfOursIsCountedAndToldOnce) {
  RtpElement depay("rtplfdepay", kRtpAnswerCaps);
  GstBus* bus = gst_bus_new();
  gst_element_set_bus(depay.element(), bus);
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
  GstMessage* told = gst_bus_pop(bus);
  ASSERT_TRUE(told);
  EXPECT_EQ(GST_MESSAGE_TYPE(told), GST_MESSAGE_WARNING);
  gst_message_unref(told);
  EXPECT_FALSE(gst_bus_have_pending(bus));
  gst_element_set_bus(depay.element(), nullptr);
  gst_object_unref(bus);
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

TEST(RtpLfDepay, JitterbufferEventsMakeNoGaps) {
  RtpElement depay("rtplfdepay", kRtpAnswerCaps);
  const std::vector<Bytes> packets = rtp_packets({rtp::answer_with_sum(100, 100, false)});
  depay.push(packets[0]);
  while (GstEvent* event = gst_harness_try_pull_event(depay.h())) gst_event_unref(event);
  gst_harness_push_event(
      depay.h(), gst_event_new_custom(GST_EVENT_CUSTOM_DOWNSTREAM,
                                      gst_structure_new("GstRTPPacketLost", "seqnum", G_TYPE_UINT, 65531u, "timestamp",
                                                        G_TYPE_UINT64, guint64{0}, "duration", G_TYPE_UINT64,
                                                        guint64{0}, "retry", G_TYPE_UINT, 0u, nullptr)));
  EXPECT_FALSE(gst_harness_try_pull_event(depay.h()));
  depay.push(packets[2]);
  EXPECT_EQ(depay.units().size(), 2u);
  EXPECT_EQ(stat(depay.element(), "lost"), 1u);
}

TEST(RtpLfDepay, WhatIsIncompleteEndsWithTheStream) {
  const std::vector<Bytes> packets = rtp_packets({rtp::answer(1, 390, 390, 90)});
  for (const bool flush : {false, true}) {
    RtpElement depay("rtplfdepay", kRtpAnswerCaps);
    depay.push(packets[0]);
    depay.push(packets[1]);
    if (flush) {
      gst_harness_push_event(depay.h(), gst_event_new_flush_start());
      gst_harness_push_event(depay.h(), gst_event_new_flush_stop(TRUE));
      GstSegment segment;
      gst_segment_init(&segment, GST_FORMAT_TIME);
      gst_harness_push_event(depay.h(), gst_event_new_segment(&segment));
      for (const Bytes& packet : packets) depay.push(packet);  // what came before the flush is forgotten
      EXPECT_EQ(depay.units().size(), 1u);
      EXPECT_EQ(stat(depay.element(), "duplicates"), 0u);
    } else {
      gst_harness_push_event(depay.h(), gst_event_new_eos());
    }
    EXPECT_EQ(stat(depay.element(), "incomplete-units"), 1u);
  }
}

TEST(RtpLfDepay, PendingBytesAreBounded) {
  RtpElement depay("rtplfdepay max-pending-bytes=65536", kRtpAnswerCaps);
  std::vector<Bytes> answers(6, rtp::answer(1, 399, 399, 95));
  std::vector<Bytes> packets = rtp_packets(answers);
  ASSERT_GT(answers[0].size(), 15000u);
  std::erase_if(packets, [](const Bytes& packet) { return packet[1] & 0x80; });  // none is ever complete
  for (const Bytes& packet : packets) depay.push(packet);
  EXPECT_TRUE(depay.units().empty());
  EXPECT_GE(stat(depay.element(), "incomplete-units"), 1u);
}

TEST(RtpLfDepay, IsALink) { EXPECT_FALSE(passes_in_process_query("rtplfdepay", kRtpAnswerCaps)); }

TEST(RtpLfDepay, StatsHaveThoseOfEveryDepayloader) {
  RtpElement depay("rtplfdepay", kRtpAnswerCaps);
  depay.push(rtp_packets({rtp::answer(1, 10, 10, 0)}, false, 1234)[0]);
  GstStructure* stats = nullptr;
  g_object_get(depay.element(), "stats", &stats, nullptr);
  const StructurePtr owner(stats);
  guint seqnum = 0;
  EXPECT_TRUE(gst_structure_get_uint(stats, "seqnum", &seqnum));
  EXPECT_EQ(seqnum, 1234u);
}

}  // namespace
}  // namespace lf::test
