// SPDX-License-Identifier: LGPL-2.1-or-later
#include "camsrc/camera_service.h"

#include <gtest/gtest.h>

namespace lf::test {
namespace {

using State = CameraService::State;
constexpr uint64_t kSecond = 1'000'000'000;

TEST(CameraServiceTest, IsLostUntilItGivesAFrame) {
  CameraService service;
  EXPECT_EQ(service.state(), State::kStopped);
  service.start();
  EXPECT_EQ(service.state(), State::kOpening);
  EXPECT_FALSE(service.find(1)) << "it was not lost";
  EXPECT_TRUE(service.lose("unplugged", 2));
  EXPECT_FALSE(service.lose("busy", 3)) << "it was lost already";
  service.end();
  service.retry();
  EXPECT_EQ(service.state(), State::kLost);
  EXPECT_EQ(service.report().reason, "busy");
  EXPECT_EQ(service.report().losses, 1u);
  EXPECT_EQ(service.report().retries, 1u);
  EXPECT_TRUE(service.find(4));
  EXPECT_EQ(service.state(), State::kRunning);
  service.start();
  EXPECT_EQ(service.report().losses, 0u);
  EXPECT_FALSE(service.report().worked);
}

TEST(CameraServiceTest, WaitsForAQuarterOfTheTimeItIsOut) {
  CameraService service;
  service.start();
  const uint64_t lost = 100 * kSecond;
  service.lose("unplugged", lost);
  EXPECT_EQ(service.wait(lost), kSecond / 2);
  EXPECT_EQ(service.wait(lost + 4 * kSecond), kSecond);
  EXPECT_EQ(service.wait(lost + 20 * kSecond), 5 * kSecond);
  EXPECT_EQ(service.wait(lost + 1000 * kSecond), 10 * kSecond);
}

TEST(CameraServiceTest, ACameraThatComesAndGoesIsWaitedForEverLonger) {
  CameraService service;
  service.start();
  uint64_t now = 100 * kSecond, wait = 0, last = 0;
  for (int i = 0; i < 60; i++) {  // it works for a third of a second each time
    service.lose("loose cable", now);
    last = wait;
    wait = service.wait(now);
    EXPECT_GE(wait, last);
    now += wait;
    service.find(now);
    now += kSecond / 3;
  }
  EXPECT_EQ(wait, 10 * kSecond);
  now += 11 * kSecond;  // it has held
  service.lose("loose cable", now);
  EXPECT_EQ(service.wait(now), kSecond / 2);
}

using Verdict = CameraShedder::Verdict;
constexpr GstClockTime kPeriod = 40 * GST_MSECOND;

std::shared_ptr<CameraShedder> shedder(bool paced) {
  auto made = std::make_shared<CameraShedder>();
  made->restart(paced);
  return made;
}

// Verdicts about a second of frames late by `from` to `to`.
std::vector<Verdict> second(CameraShedder& shedder, int n, GstClockTimeDiff from, GstClockTimeDiff to,
                            GstClockTime latency = 0) {
  std::vector<Verdict> verdicts;
  for (int i = 0; i < 25; i++) {
    const GstClockTime pts = n * GST_SECOND + i * kPeriod;
    verdicts.push_back(
        shedder.see(pts, from + (to - from) * i / 24, latency, kPeriod, pts + 3600 * kSecond * n + 1000 * kSecond));
  }
  return verdicts;
}
bool begins(const std::vector<Verdict>& verdicts) {
  return std::find(verdicts.begin(), verdicts.end(), Verdict::kBeginToDrop) != verdicts.end();
}

TEST(CameraShedderTest, OnlyWhatStaysLateIsTooMuch) {
  EXPECT_FALSE(begins(second(*shedder(true), 1, 0, 90 * GST_MSECOND))) << "within the tolerance";
  EXPECT_FALSE(begins(second(*shedder(true), 2, 400 * GST_MSECOND, 0))) << "it catches up";
  EXPECT_FALSE(begins(second(*shedder(false), 3, 400 * GST_MSECOND, 400 * GST_MSECOND))) << "a network's own delay";
  EXPECT_FALSE(begins(second(*shedder(false), 6, 0, 240 * GST_MSECOND, 200 * GST_MSECOND))) << "it was said";
  EXPECT_TRUE(begins(second(*shedder(true), 4, 400 * GST_MSECOND, 400 * GST_MSECOND)));
  EXPECT_TRUE(begins(second(*shedder(false), 5, 200 * GST_MSECOND, 600 * GST_MSECOND)));
}

TEST(CameraShedderTest, OneCameraAfterTheOther) {
  const auto first = shedder(true), next = shedder(true);
  const uint64_t begun = 1'000'000 * kSecond;
  int begin = 0;
  for (int i = 0; i < 22; i++)  // 0.9 s: enough for the patience, and for one more camera but not for two
    for (const auto& one : {first, next})
      begin += one->see(i * kPeriod, GST_SECOND, 0, kPeriod, begun + i * kPeriod) == Verdict::kBeginToDrop;
  EXPECT_EQ(begin, 2);
  EXPECT_GT(first->behind(), 0);
}

TEST(CameraShedderTest, WhatIsOnItsWayWhenOthersAreDroppedIsLeftOut) {
  const auto one = shedder(true);
  const uint64_t begun = 2'000'000 * kSecond;
  GstClockTime pts = 0;
  Verdict verdict = Verdict::kShow;
  for (; verdict == Verdict::kShow; pts += kPeriod) verdict = one->see(pts, GST_SECOND, 0, kPeriod, begun + pts);
  ASSERT_EQ(verdict, Verdict::kBeginToDrop);
  EXPECT_EQ(one->see(pts, GST_SECOND, 0, kPeriod, begun + pts), Verdict::kLeaveOut);
  EXPECT_EQ(one->see(pts + GST_SECOND, 0, 0, kPeriod, begun + pts), Verdict::kShow);
}

}  // namespace
}  // namespace lf::test
