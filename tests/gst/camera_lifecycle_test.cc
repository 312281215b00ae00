// SPDX-License-Identifier: LGPL-2.1-or-later
#include "camsrc/camera_lifecycle.h"

#include "support/test.h"

namespace lf::test {
namespace {

using State = CameraLifecycle::State;
constexpr uint64_t kSecond = 1'000'000'000;

TEST(CameraLifecycleTest, StaysLostUntilTheFirstFrame) {
  CameraLifecycle service;
  EXPECT_EQ(service.state(), State::kStopped);
  service.start();
  EXPECT_EQ(service.state(), State::kOpening);
  EXPECT_FALSE(service.find(1)) << "not lost";
  EXPECT_TRUE(service.lose("unplugged", 2));
  EXPECT_FALSE(service.lose("busy", 3)) << "already lost";
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

TEST(CameraLifecycleTest, RetryDelayIsAQuarterOfTheOutage) {
  CameraLifecycle service;
  service.start();
  const uint64_t lost = 100 * kSecond;
  service.lose("unplugged", lost);
  EXPECT_EQ(service.wait(lost), kSecond / 2);
  EXPECT_EQ(service.wait(lost + 4 * kSecond), kSecond);
  EXPECT_EQ(service.wait(lost + 20 * kSecond), 5 * kSecond);
  EXPECT_EQ(service.wait(lost + 1000 * kSecond), 10 * kSecond);
}

TEST(CameraLifecycleTest, RetryDelayGrowsForUnstableCameras) {
  CameraLifecycle service;
  service.start();
  uint64_t now = 100 * kSecond, wait = 0, last = 0;
  for (int i = 0; i < 60; i++) {
    service.lose("loose cable", now);
    last = wait;
    wait = service.wait(now);
    EXPECT_GE(wait, last);
    now += wait;
    service.find(now);
    now += kSecond / 3;
  }
  EXPECT_EQ(wait, 10 * kSecond);
  now += 11 * kSecond;
  service.lose("loose cable", now);
  EXPECT_EQ(service.wait(now), kSecond / 2);
}

using Verdict = LoadShedder::Verdict;
constexpr GstClockTime kPeriod = 40 * GST_MSECOND;

std::shared_ptr<LoadShedder> shedder(bool paced) {
  auto made = std::make_shared<LoadShedder>();
  made->restart(paced);
  return made;
}

// Feeds one second of frames; their lateness goes from `from` to `to`. Returns the verdicts.
std::vector<Verdict> second(LoadShedder& shedder, int n, GstClockTimeDiff from, GstClockTimeDiff to,
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
  return std::find(verdicts.begin(), verdicts.end(), Verdict::kStartDropping) != verdicts.end();
}

TEST(LoadShedderTest, OnlyLastingLatenessStartsDropping) {
  EXPECT_FALSE(begins(second(*shedder(true), 1, 0, 90 * GST_MSECOND))) << "within the tolerance";
  EXPECT_FALSE(begins(second(*shedder(true), 2, 400 * GST_MSECOND, 0))) << "the camera catches up";
  EXPECT_FALSE(begins(second(*shedder(false), 3, 400 * GST_MSECOND, 400 * GST_MSECOND))) << "network delay";
  EXPECT_FALSE(begins(second(*shedder(false), 6, 0, 240 * GST_MSECOND, 200 * GST_MSECOND))) << "already reported";
  EXPECT_TRUE(begins(second(*shedder(true), 4, 400 * GST_MSECOND, 400 * GST_MSECOND)));
  EXPECT_TRUE(begins(second(*shedder(false), 5, 200 * GST_MSECOND, 600 * GST_MSECOND)));
}

TEST(LoadShedderTest, CamerasStartDroppingOneByOne) {
  const auto first = shedder(true), next = shedder(true);
  const uint64_t begun = 1'000'000 * kSecond;
  int begin = 0;
  for (int i = 0; i < 22; i++)  // 0.9 s: enough to drop one more camera, but not two
    for (const auto& one : {first, next})
      begin += one->see(i * kPeriod, GST_SECOND, 0, kPeriod, begun + i * kPeriod) == Verdict::kStartDropping;
  EXPECT_EQ(begin, 2);
  EXPECT_GT(first->behind(), 0);
}

TEST(LoadShedderTest, FramesInTheDecoderAreDropped) {
  const auto one = shedder(true);
  const uint64_t begun = 2'000'000 * kSecond;
  GstClockTime pts = 0;
  Verdict verdict = Verdict::kShow;
  for (; verdict == Verdict::kShow; pts += kPeriod) verdict = one->see(pts, GST_SECOND, 0, kPeriod, begun + pts);
  ASSERT_EQ(verdict, Verdict::kStartDropping);
  EXPECT_EQ(one->see(pts, GST_SECOND, 0, kPeriod, begun + pts), Verdict::kDrop);
  EXPECT_EQ(one->see(pts + GST_SECOND, 0, 0, kPeriod, begun + pts), Verdict::kShow);
}

}  // namespace
}  // namespace lf::test
