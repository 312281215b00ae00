// SPDX-License-Identifier: LGPL-2.1-or-later
#include "node/frame_timing.h"

#include "support/test.h"

namespace lf {
namespace {

constexpr uint64_t kPeriod = 100, kWanted = 10'000;

SkewMonitor::Frame frame(CameraIndex camera, int64_t skew, uint64_t period = kPeriod) {
  return {camera, kWanted + static_cast<uint64_t>(skew), kWanted, period};
}

TEST(SkewMonitor, ReportsAnUnsynchronisedCameraOnce) {
  SkewMonitor watch;
  const SkewMonitor::Frame frames[] = {frame(2, 60), frame(5, -130)};
  int reports = 0;
  for (int i = 1; i < 50; i++) {
    const auto report = watch.see(frames);
    if (!report) continue;
    reports++;
    EXPECT_EQ(i, SkewMonitor::kRequests);
    EXPECT_THAT(report->cameras, ElementsAre(5));
    EXPECT_EQ(report->skew, 130u);
    EXPECT_EQ(report->period, kPeriod);
    EXPECT_TRUE(report->is_late);
  }
  EXPECT_EQ(reports, 1);
}

TEST(SkewMonitor, ReportsTheDelayOfTheWorstFrame) {
  SkewMonitor watch;
  SkewMonitor::Frame frames[] = {frame(2, -200), frame(5, -300)};
  frames[0].behind = 150;
  frames[1].behind = 250;
  std::optional<SkewMonitor::Report> report;
  for (int i = 0; i < SkewMonitor::kRequests; i++) report = watch.see(frames);
  ASSERT_TRUE(report);
  EXPECT_EQ(report->behind, 250u);
}

TEST(SkewMonitor, IgnoresLostFrames) {
  SkewMonitor watch;
  for (int i = 0; i < 100; i++) {
    const SkewMonitor::Frame frames[] = {frame(0, i % SkewMonitor::kRequests == 0 ? 20 : 300)};
    EXPECT_FALSE(watch.see(frames)) << i;
  }
}

TEST(SkewMonitor, ToleratesOneFrameInterval) {
  SkewMonitor watch;
  for (int i = 0; i < 20; i++) {
    const SkewMonitor::Frame frames[] = {frame(0, -100), frame(1, 110), frame(2, 100'000, 0)};
    EXPECT_FALSE(watch.see(frames)) << i;
  }
}

TEST(SkewMonitor, ReportsACameraAgainAfterRecovery) {
  SkewMonitor watch;
  const auto run = [&](int64_t skew, int requests) {
    int reports = 0;
    for (int i = 0; i < requests; i++) {
      const SkewMonitor::Frame frames[] = {frame(0, skew)};
      const auto report = watch.see(frames);
      if (!report) continue;
      reports++;
      EXPECT_FALSE(report->is_late);
    }
    return reports;
  };
  EXPECT_EQ(run(500, 20), 1);
  EXPECT_EQ(run(0, SkewMonitor::kRequests - 1), 0);
  EXPECT_EQ(run(500, 20), 0) << "not stable long enough";
  EXPECT_EQ(run(0, SkewMonitor::kRequests), 0);
  EXPECT_EQ(run(500, 20), 1);
}

constexpr uint64_t kMs = 1'000'000;

TEST(ArrivalMonitor, NeededDelayIsThePercentilePlusHalfAFrame) {
  ArrivalMonitor watch;
  EXPECT_EQ(watch.needed(40 * kMs, 0), 0u) << "no measurements";
  for (uint64_t i = 1; i <= 200; i++) watch.arrived(i * 40 * kMs, i * 40 * kMs + (i == 150 ? 500 : 10 + i % 10) * kMs);
  EXPECT_EQ(watch.needed(40 * kMs, 200 * 40 * kMs + 20 * kMs), (19 + 20) * kMs);
  EXPECT_EQ(watch.needed(0, 200 * 40 * kMs + 20 * kMs), 19 * kMs);
}

TEST(ArrivalMonitor, OldFramesAreForgotten) {
  ArrivalMonitor watch;
  for (uint64_t i = 1; i <= 200; i++) watch.arrived(i * kMs, i * kMs + 300 * kMs);
  EXPECT_EQ(watch.needed(0, 500 * kMs), 300 * kMs);
  for (uint64_t i = 201; i <= 201 + ArrivalMonitor::kFrames; i++) watch.arrived(i * kMs, i * kMs + 5 * kMs);
  EXPECT_EQ(watch.needed(0, 500 * kMs), 5 * kMs);
}

TEST(ArrivalMonitor, SilentCameraNeedsNothing) {
  ArrivalMonitor watch;
  watch.arrived(100 * kMs, 130 * kMs);
  EXPECT_EQ(watch.needed(0, 130 * kMs + ArrivalMonitor::kSilence), 30 * kMs);
  EXPECT_EQ(watch.needed(0, 131 * kMs + ArrivalMonitor::kSilence), 0u);
  watch.arrived(10'000 * kMs, 9'990 * kMs);
  EXPECT_EQ(watch.needed(0, 10'000 * kMs), 30 * kMs) << "a stamp from the future counts as no delay";
}

constexpr uint64_t kSecond = DelayReporter::kSecond, kBegin = 1000 * kSecond;

TEST(DelayReporter, GrowingDelaysAreReportedSoon) {
  DelayReporter notice;
  ASSERT_TRUE(notice.is_due(kBegin));
  EXPECT_TRUE(notice.see(30, kBegin));
  EXPECT_FALSE(notice.is_due(kBegin + kSecond / 20));
  ASSERT_TRUE(notice.is_due(kBegin + kSecond / 10));
  EXPECT_TRUE(notice.see(31, kBegin + kSecond / 10));
}

TEST(DelayReporter, EqualDelaysAreReportedOncePerSecond) {
  DelayReporter notice;
  EXPECT_TRUE(notice.see(30, kBegin));
  EXPECT_FALSE(notice.see(30, kBegin + kSecond / 2));
  EXPECT_FALSE(notice.see(20, kBegin + kSecond - 1));
  EXPECT_TRUE(notice.see(20, kBegin + kSecond));
}

TEST(DelayReporter, UnknownDelayIsCheckedAgain) {
  DelayReporter notice;
  EXPECT_FALSE(notice.see(0, kBegin));
  EXPECT_TRUE(notice.is_due(kBegin + 1));
  EXPECT_TRUE(notice.see(30, kBegin + 1));
}

}  // namespace
}  // namespace lf
