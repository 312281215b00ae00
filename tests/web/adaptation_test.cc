// SPDX-License-Identifier: LGPL-2.1-or-later
#include "serve/adaptation.h"
#include "support/test.h"

namespace lf::serve {
namespace {

TEST(RequestPacer, ReportsTheFractionOfSentRequests) {
  RequestPacer pace(1);
  EXPECT_EQ(pace.kept(), 1);
  pace.set_interval(10);
  EXPECT_TRUE(pace.begin(0));
  EXPECT_FALSE(pace.begin(5)) << "too early";
  EXPECT_FALSE(pace.begin(10));
  EXPECT_EQ(pace.kept(), 0.5);
  pace.end(0);
  EXPECT_TRUE(pace.begin(20));
  EXPECT_EQ(pace.kept(), 1);
}

TEST(RequestPacer, WaitsForPicturesWithATimeout) {
  RequestPacer pace(2);
  EXPECT_TRUE(pace.begin(10));
  EXPECT_TRUE(pace.begin(20));
  EXPECT_FALSE(pace.begin(30));
  pace.end(10);
  EXPECT_TRUE(pace.begin(40));
  EXPECT_FALSE(pace.begin(50));
  pace.end(40);
  EXPECT_TRUE(pace.begin(60));
  EXPECT_TRUE(pace.begin(70));
  EXPECT_FALSE(pace.begin(60 + RequestPacer::kPatience));
  EXPECT_TRUE(pace.begin(61 + RequestPacer::kPatience));
  pace.end(60);
  EXPECT_FALSE(pace.begin(62 + RequestPacer::kPatience)) << "late frames give no credit";
  pace.end(70 + RequestPacer::kPatience);
  pace.set_interval(100);
  EXPECT_FALSE(pace.begin(160 + RequestPacer::kPatience));
  EXPECT_TRUE(pace.begin(161 + RequestPacer::kPatience));
}

TEST(RequestPacer, SendsNoMoreThanAreAnswered) {
  RequestPacer pace(2);
  EXPECT_TRUE(pace.begin(100));
  EXPECT_TRUE(pace.begin(200));
  EXPECT_FALSE(pace.begin(300));
  pace.end(100);
  EXPECT_TRUE(pace.begin(400));
  EXPECT_DOUBLE_EQ(pace.kept(), 3.0 / 4);
  EXPECT_DOUBLE_EQ(pace.kept(), 1) << "no request since";
}

TEST(RequestPacer, DoesNotWaitLongForMissingPictures) {
  RequestPacer pace(1);
  EXPECT_TRUE(pace.begin(100));
  EXPECT_FALSE(pace.begin(100 + RequestPacer::kPatience));
  EXPECT_TRUE(pace.begin(101 + RequestPacer::kPatience));
}

TEST(RequestPacer, SkipsRequestsThatAreTooEarly) {
  RequestPacer pace(9);
  pace.set_interval(50);
  EXPECT_TRUE(pace.begin(100));
  EXPECT_FALSE(pace.begin(149));
  EXPECT_TRUE(pace.begin(150));
  EXPECT_DOUBLE_EQ(pace.kept(), 1) << "not requested";
}

TEST(RequestPacer, RequestsEqualPicturesLessAndLessOften) {
  RequestPacer pace(9);
  const auto wait_after = [&](uint64_t time) {  // for the next request, in steps
    pace.end(time);
    uint64_t steps = 0;
    while (!pace.begin(time + 1 + steps * RequestPacer::kRestStep)) steps++;
    return steps;
  };
  uint64_t time = 1'000'000'000;
  for (unsigned i = 0; i < RequestPacer::kRepeats; i++, pace.note_repeat(true)) EXPECT_TRUE(pace.begin(++time)) << i;
  EXPECT_FALSE(pace.is_resting());
  for (const uint64_t expected : {0, 1, 2, 3, 4, 4, 4}) {
    const uint64_t steps = wait_after(time);
    EXPECT_EQ(steps, expected);
    time += 1 + steps * RequestPacer::kRestStep;
    pace.note_repeat(true);
    EXPECT_TRUE(pace.is_resting());
  }
  EXPECT_EQ(pace.kept(), 1) << "the machine is not too slow";
  pace.note_repeat(false);
  EXPECT_FALSE(pace.is_resting());
  EXPECT_EQ(wait_after(time), 0u);
}

TEST(QualityControl, BitRateDropsWithLossAndDelayAndRecovers) {
  QualityControl quality(300000, 6000000, 0);
  EXPECT_EQ(quality.bits_per_second(), 6000000);
  EXPECT_FALSE(quality.update(0, 0.01));
  EXPECT_TRUE(quality.update(0.1, 0.01));
  EXPECT_EQ(quality.bits_per_second(), 4500000);
  EXPECT_FALSE(quality.update(0.03, 0.01)) << "unchanged with some loss";
  EXPECT_TRUE(quality.update(0, 0.2)) << "packets queue up";
  EXPECT_LT(quality.bits_per_second(), 4500000);
  for (int i = 0; i < 100; i++) quality.update(0.5, 0);
  EXPECT_EQ(quality.bits_per_second(), 300000);
  for (int i = 0; i < 100; i++) quality.update(0, 0.01);
  EXPECT_EQ(quality.bits_per_second(), 6000000);
}

TEST(QualityControl, ReducesTheRateAndThenTheSize) {
  QualityControl quality(100000, 1000000, 640 * 480 * 30);
  const auto lossy = [&](int times) {
    for (int i = 0; i < times; i++) quality.update(0.1, 0);
  };
  EXPECT_EQ(quality.pictures_left_out(), 0);
  lossy(2);
  EXPECT_EQ(quality.pictures_left_out(), 0);
  lossy(1);  // 422: 0.046 bits per pixel
  EXPECT_EQ(quality.pictures_left_out(), 1);
  EXPECT_EQ(quality.size_divisor(), 1);
  lossy(3);
  EXPECT_EQ(quality.pictures_left_out(), 1);
  EXPECT_EQ(quality.size_divisor(), 2);
  for (int i = 0; i < 5; i++) quality.update(0, 0);
  EXPECT_EQ(quality.size_divisor(), 2);
  for (int i = 0; i < 2; i++) quality.update(0, 0);
  EXPECT_EQ(quality.size_divisor(), 1);
  EXPECT_EQ(quality.pictures_left_out(), 1);
  for (int i = 0; i < 30; i++) quality.update(0, 0);
  EXPECT_EQ(quality.pictures_left_out(), 0);
}

class LoadSheddingTest : public testing::Test {
 protected:
  int seconds(double busy, double kept, int most = 1000) {
    for (int i = 1; i <= most; i++)
      if (shedding_.update(busy, kept)) return i;
    return most + 1;
  }
  LoadShedding shedding_;
};

TEST_F(LoadSheddingTest, ReducesHypothesesThenRateThenSize) {
  struct Step {
    unsigned hypotheses;
    int left_out, divisor;
  };
  for (const Step& step : {Step{3, 0, 1}, Step{8, 0, 1}, Step{8, 1, 1}, Step{8, 1, 2}}) {
    EXPECT_EQ(seconds(1, 0.5), LoadShedding::kPatience);
    EXPECT_EQ(shedding_.depth_interval(), step.hypotheses);
    EXPECT_EQ(shedding_.pictures_left_out(), step.left_out);
    EXPECT_EQ(shedding_.size_divisor(), step.divisor);
  }
  EXPECT_EQ(seconds(1, 0.5, 100), 101) << "there is nothing else";
  for (int step = 3; step >= 0; step--) {
    seconds(0.3, 1);
    EXPECT_EQ(shedding_.step(), step);
  }
  EXPECT_EQ(shedding_.depth_interval(), 1u);
}

TEST_F(LoadSheddingTest, ActsOnlyIfProcessorsAreBusy) {
  EXPECT_EQ(seconds(0.5, 0.1, 100), 101) << "cameras on other hosts may be slow";
  EXPECT_EQ(seconds(1, 1, 100), 101) << "all pictures are rendered";
  for (int i = 0; i < 50; i++) {
    shedding_.update(1, 0.5);
    EXPECT_FALSE(shedding_.update(1, 1)) << "a short overload does not count";
  }
}

TEST_F(LoadSheddingTest, FailedRecoveriesAreRetriedLessOften) {
  seconds(1, 0.5);
  int before = 0;
  for (int i = 0; i < 4; i++) {
    const int rest = seconds(0.5, 1);
    EXPECT_GT(rest, before);
    before = rest;
    EXPECT_EQ(shedding_.step(), 0);
    EXPECT_EQ(seconds(1, 0.5), LoadShedding::kPatience);
  }
  EXPECT_EQ(seconds(0.8, 1, 1000), 1001) << "not enough bandwidth";
}

TEST(ProcessorLoad, IsBetweenZeroAndOne) {
  ProcessorLoad load;
  load.update();
  const auto until = std::chrono::steady_clock::now() + std::chrono::milliseconds(100);
  while (std::chrono::steady_clock::now() < until) {
  }
  const double busy = load.update();
  EXPECT_GT(busy, 0);
  EXPECT_LE(busy, 1);
}

TEST(QualityControl, RepeatsKeyFramesOfANewSizeDuringLosses) {
  QualityControl quality(100000, 1000000, 640 * 480 * 30);
  while (quality.size_divisor() == 1) {
    quality.update(0.3, 0);
    EXPECT_FALSE(quality.wants_key_frame()) << "the new size has its own rate";
  }
  for (int i = 0; i < QualityControl::kKeyFrameRepeats; i++) {
    quality.update(i == 2 ? 0 : 0.3, 0);
    EXPECT_EQ(quality.wants_key_frame(), i != 2) << i;
  }
  quality.update(0.3, 0);
  EXPECT_FALSE(quality.wants_key_frame());
  while (quality.size_divisor() == 2) quality.update(0, 0);
  quality.update(0.1, 0);
  EXPECT_TRUE(quality.wants_key_frame()) << "the larger size, too";
}

TEST(QualityControl, LowBitRatesReduceTheQuality) {
  EXPECT_EQ(QualityControl(100000, 200000, 640 * 480 * 30).size_divisor(), 2);
  QualityControl quality(100000, 480000, 640 * 480 * 30);
  EXPECT_EQ(quality.pictures_left_out(), 0);
  quality.update(0.1, 0);
  EXPECT_EQ(quality.pictures_left_out(), 1);
  for (int i = 0; i < 10; i++) quality.update(0, 0);
  EXPECT_EQ(quality.pictures_left_out(), 0) << "nothing left to wait for";
}

TEST(RequestPhase, PhasesOfConsecutiveViewersAreSpread) {
  for (const uint32_t first : {0u, 1u, 6u, 1000000u, 4294967280u})
    for (const int count : {1, 2, 4, 8}) {
      std::vector<double> turns;
      for (int i = 0; i < count; i++) turns.push_back(request_phase(first + static_cast<uint32_t>(i)));
      std::ranges::sort(turns);
      EXPECT_GE(turns.front(), 0);
      EXPECT_LT(turns.back(), 1);
      turns.push_back(turns.front() + 1);
      for (size_t i = 1; i < turns.size(); i++)
        EXPECT_GE(turns[i] - turns[i - 1], 0.5 / count) << count << " viewers from " << first;
    }
}

using Bytes = std::vector<uint8_t>;

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

TEST(RtcpFilter, KeepsNeededPackets) {
  for (const Bytes& needed : {kReport, kNack, kPli, kFir, kReport + kNack + kPli})
    EXPECT_EQ(RtcpFilter::filter_compound(needed), std::nullopt);
}

TEST(RtcpFilter, RemovesOtherPackets) {
  const Bytes synchronise = packet(205, 5, 4), congestion = packet(205, 15, 40), goodbye = packet(203, 31, 0),
              names = packet(202, 1, 8), sender_report = packet(200, 0, 20), extended = packet(207, 0, 12),
              application = packet(204, 0, 4), bandwidth = packet(206, 15, 12);
  for (const Bytes& other :
       {synchronise, congestion, goodbye, names, sender_report, extended, application, bandwidth}) {
    EXPECT_EQ(RtcpFilter::filter_compound(other), Bytes{});
    EXPECT_EQ(RtcpFilter::filter_compound(kReport + other), kReport);
    EXPECT_EQ(RtcpFilter::filter_compound(other + kReport + other + kNack), kReport + kNack);
  }
}

TEST(RtcpFilter, StopsAtAMalformedPacket) {
  Bytes too_long = kNack, wrong_version = kNack, padded = kNack;
  too_long[3] = 200;
  wrong_version[0] = 0x41;
  padded[0] |= 0x20;
  for (const Bytes& bad : {too_long, wrong_version, padded, Bytes{0x81}, Bytes{0x81, 201, 0, 0, 0, 0, 0, 1}}) {
    EXPECT_EQ(RtcpFilter::filter_compound(bad), Bytes{});
    EXPECT_EQ(RtcpFilter::filter_compound(kReport + bad), kReport);
  }
}

TEST(RtcpFilter, RandomBytesYieldOnlyNeededPackets) {
  std::mt19937 random(1);
  for (int n = 0; n < 100'000; n++) {
    Bytes bytes;
    while (random() % 4) {
      bytes = bytes + packet(static_cast<uint8_t>(198 + random() % 12), random() % 32, 4 * (random() % 12));
      if (random() % 3 == 0) bytes[random() % bytes.size()] = static_cast<uint8_t>(random());
    }
    if (random() % 2 && !bytes.empty()) bytes.resize(random() % bytes.size());
    const Bytes kept = RtcpFilter::filter_compound(bytes).value_or(bytes);
    ASSERT_LE(kept.size(), bytes.size());
    ASSERT_EQ(RtcpFilter::filter_compound(kept), kept.empty() ? std::optional(kept) : std::nullopt);
  }
}

TEST(RtcpFilter, AcceptsRtcpOfAFewSendersAndNoRtp) {
  RtcpFilter filter;
  const Bytes dtls(20, 22), rtp = packet(96, 0, 100);
  for (int i = 0; i < 1000; i++) {
    EXPECT_TRUE(filter.accept_encrypted(dtls, i));
    EXPECT_FALSE(filter.accept_encrypted(rtp, i));
  }
  size_t passed = 0;
  for (uint32_t ssrc = 0; ssrc < 100; ssrc++) passed += filter.accept_encrypted(packet(201, 0, 0, ssrc), 1000);
  EXPECT_EQ(passed, RtcpFilter::kMaxSenders);
  EXPECT_TRUE(filter.accept_encrypted(packet(201, 0, 0, 0), 1000)) << "admitted requests continue";
  EXPECT_FALSE(filter.accept_encrypted({}, 1000));
  EXPECT_FALSE(filter.accept_encrypted(Bytes(7, 0x80), 1000));
  EXPECT_FALSE(filter.accept_encrypted(packet(201, 0, 2000, 0), 1000));
}

TEST(RtcpFilter, LimitsTheRate) {
  RtcpFilter filter;
  double passed = 0;
  for (int ms = 0; ms < 10'000; ms++) passed += filter.accept_encrypted(kReport, ms * 1000);
  EXPECT_NEAR(passed, RtcpFilter::kAtOnce + 10 * RtcpFilter::kPerSecond, 2);
}

TEST(PacketLoss, IsMeasuredBetweenReports) {
  PacketLoss loss;
  EXPECT_EQ(loss.update({}), 0);
  EXPECT_EQ(loss.update({{1, 70000, 25}}), 0) << "the first one only says where streams are";
  EXPECT_EQ(loss.update({{1, 70100, 50}}), 0.25);
  EXPECT_EQ(loss.update({{1, 70100, 50}}), 0.25) << "nothing new";
  EXPECT_EQ(loss.update({}), 0.25);
  EXPECT_EQ(loss.update({{1, 70200, 50}}), 0);
  EXPECT_EQ(loss.update({{1, 70300, 45}}), 0) << "some came after all";
  EXPECT_EQ(loss.update({{1, 70310, 90}}), 1) << "and others were late";
  EXPECT_EQ(loss.update({{1, 70350, 100}, {2, 0xfffffff0, 3}}), 0.25) << "the new stream is unknown";
  EXPECT_EQ(loss.update({{1, 70400, 100}, {2, 34, 28}}), 0.25) << "both, with restarted numbers";
}

}  // namespace
}  // namespace lf::serve
