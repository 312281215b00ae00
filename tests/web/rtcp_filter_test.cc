// SPDX-License-Identifier: LGPL-2.1-or-later
#include "serve/rtcp_filter.h"

#include <gtest/gtest.h>

#include <random>

namespace lf::serve {
namespace {

using Bytes = std::vector<uint8_t>;

// A packet of `type`, `format` or count, and so many bytes behind the sender's SSRC.
Bytes packet(uint8_t type, uint8_t format, size_t more, uint32_t ssrc = 1) {
  Bytes bytes{static_cast<uint8_t>(0x80 | format), type, 0, static_cast<uint8_t>(1 + more / 4)};
  for (int shift = 24; shift >= 0; shift -= 8) bytes.push_back(static_cast<uint8_t>(ssrc >> shift));
  bytes.resize(8 + more, 0x11);
  return bytes;
}
Bytes operator+(Bytes a, const Bytes& b) {
  a.insert(a.end(), b.begin(), b.end());
  return a;
}
const Bytes kReport = packet(201, 1, 24), kNack = packet(205, 1, 8), kPli = packet(206, 1, 4),
            kFir = packet(206, 4, 12);

TEST(RtcpFilter, KeepsWhatAViewerNeeds) {
  for (const Bytes& needed : {kReport, kNack, kPli, kFir, kReport + kNack + kPli})
    EXPECT_EQ(RtcpFilter::needed_part(needed), std::nullopt);
}

TEST(RtcpFilter, TakesEverythingElseOut) {
  const Bytes synchronise = packet(205, 5, 4), congestion = packet(205, 15, 40), goodbye = packet(203, 31, 0),
              names = packet(202, 1, 8), sender_report = packet(200, 0, 20), extended = packet(207, 0, 12),
              application = packet(204, 0, 4), bandwidth = packet(206, 15, 12);
  for (const Bytes& other :
       {synchronise, congestion, goodbye, names, sender_report, extended, application, bandwidth}) {
    EXPECT_EQ(RtcpFilter::needed_part(other), Bytes{});
    EXPECT_EQ(RtcpFilter::needed_part(kReport + other), kReport);
    EXPECT_EQ(RtcpFilter::needed_part(other + kReport + other + kNack), kReport + kNack);
  }
}

TEST(RtcpFilter, EndsWhereAPacketIsMalformed) {
  Bytes too_long = kNack, wrong_version = kNack, padded = kNack;
  too_long[3] = 200;
  wrong_version[0] = 0x41;
  padded[0] |= 0x20;
  for (const Bytes& bad : {too_long, wrong_version, padded, Bytes{0x81}, Bytes{0x81, 201, 0, 0, 0, 0, 0, 1}}) {
    EXPECT_EQ(RtcpFilter::needed_part(bad), Bytes{});
    EXPECT_EQ(RtcpFilter::needed_part(kReport + bad), kReport);
  }
}

TEST(RtcpFilter, RandomBytesGiveNeededPacketsAlone) {
  std::mt19937 random(1);
  for (int n = 0; n < 100'000; n++) {
    Bytes bytes;
    while (random() % 4) {
      bytes = bytes + packet(static_cast<uint8_t>(198 + random() % 12), random() % 32, 4 * (random() % 12));
      if (random() % 3 == 0) bytes[random() % bytes.size()] = static_cast<uint8_t>(random());
    }
    if (random() % 2 && !bytes.empty()) bytes.resize(random() % bytes.size());
    const Bytes kept = RtcpFilter::needed_part(bytes).value_or(bytes);
    ASSERT_LE(kept.size(), bytes.size());
    ASSERT_EQ(RtcpFilter::needed_part(kept), kept.empty() ? std::optional(kept) : std::nullopt);
  }
}

TEST(RtcpFilter, TakesRtcpOfAFewSendersAndNoRtp) {
  RtcpFilter filter;
  const Bytes dtls(20, 22), rtp = packet(96, 0, 100);
  for (int i = 0; i < 1000; i++) {
    EXPECT_TRUE(filter.take_sealed(dtls, i));
    EXPECT_FALSE(filter.take_sealed(rtp, i));
  }
  size_t passed = 0;
  for (uint32_t ssrc = 0; ssrc < 100; ssrc++) passed += filter.take_sealed(packet(201, 0, 0, ssrc), 1000);
  EXPECT_EQ(passed, RtcpFilter::kMostSenders);
  EXPECT_TRUE(filter.take_sealed(packet(201, 0, 0, 0), 1000)) << "those that have passed go on";
  EXPECT_FALSE(filter.take_sealed({}, 1000));
  EXPECT_FALSE(filter.take_sealed(Bytes(7, 0x80), 1000));
  EXPECT_FALSE(filter.take_sealed(packet(201, 0, 2000, 0), 1000));
}

TEST(RtcpFilter, LimitsTheRate) {
  RtcpFilter filter;
  double passed = 0;
  for (int ms = 0; ms < 10'000; ms++) passed += filter.take_sealed(kReport, ms * 1000);
  EXPECT_NEAR(passed, RtcpFilter::kAtOnce + 10 * RtcpFilter::kPerSecond, 2);
}

}  // namespace
}  // namespace lf::serve
