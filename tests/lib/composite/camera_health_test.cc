// SPDX-License-Identifier: LGPL-2.1-or-later
#include "composite/camera_health.h"

#include "support/test.h"

namespace lf {
namespace {

using Answer = RequestHistory::Answer;

TEST(RequestHistory, AnswerIsInTimeUpToTheDeadline) {
  RequestHistory past;
  for (uint32_t i = 0; i < 3; i++) {
    EXPECT_FALSE(past.begin(i));
    past.composed(i, 100 * (i + 1));
  }
  EXPECT_EQ(past.judge(1, 200), Answer::kInTime);
  EXPECT_EQ(past.judge(1, 201), Answer::kLate);
  EXPECT_EQ(past.judge(2, 1000), Answer::kInTime) << "start time of the latest request unknown";
  EXPECT_EQ(past.judge(77, 0), Answer::kLate) << "unknown";
}

TEST(RequestHistory, AnswerToASkippedRequestIsNotLate) {
  RequestHistory past;
  past.skipped(4);
  past.composed(5, 10);
  EXPECT_EQ(past.judge(4, 0), Answer::kToSkipped);
  EXPECT_EQ(past.judge(5, 0), Answer::kInTime);
}

TEST(RequestHistory, ForgetsTheOldest) {
  RequestHistory past;
  const auto most = static_cast<uint32_t>(RequestHistory::kMost);
  for (uint32_t i = 0; i <= most; i++) {
    past.composed(2 * i, ~uint64_t{0});
    past.skipped(2 * i + 1);
  }
  EXPECT_EQ(past.judge(0, 0), Answer::kLate);
  EXPECT_EQ(past.judge(1, 0), Answer::kLate);
  EXPECT_EQ(past.judge(2, 0), Answer::kInTime);
  EXPECT_EQ(past.judge(3, 0), Answer::kToSkipped);
}

TEST(RequestHistory, DetectsRestartsDespiteWrapAround) {
  RequestHistory past;
  EXPECT_FALSE(past.begin(0xffffffff));
  past.composed(0xffffffff, 10);
  EXPECT_FALSE(past.begin(0)) << "the next number";
  EXPECT_EQ(past.judge(0xffffffff, 10), Answer::kInTime);
  past.composed(0, 20);
  EXPECT_FALSE(past.begin(0)) << "repeated";
  EXPECT_FALSE(past.begin(900));
  EXPECT_TRUE(past.begin(0));
  EXPECT_EQ(past.judge(0, 0), Answer::kLate);
  past.clear();
  EXPECT_FALSE(past.begin(900));
}

const CameraRanges kAll(CameraSet{0, 1, 2, 3}), kSome(CameraSet{0, 2, 3});

TEST(CameraHealth, StoppedCameraIsTakenOutAndReturns) {
  CameraHealth health(2);
  for (int i = 0; i < 10; i++) EXPECT_FALSE(health.picture(kAll));
  EXPECT_FALSE(health.picture(kSome));
  EXPECT_FALSE(health.picture(kSome));
  EXPECT_TRUE(health.out_of_service().empty());
  EXPECT_TRUE(health.picture(kSome));
  EXPECT_EQ(health.out_of_service(), CameraSet{1});
  EXPECT_FALSE(health.picture(kSome));
  for (unsigned i = 1; i < CameraHealth::kRecoveryPictures; i++) EXPECT_FALSE(health.picture(kAll));
  EXPECT_EQ(health.out_of_service(), CameraSet{1});
  EXPECT_TRUE(health.picture(kAll));
  EXPECT_TRUE(health.out_of_service().empty());
}

TEST(CameraHealth, IntermittentCameraStaysOut) {
  CameraHealth health(2);
  health.picture(kAll);
  for (int i = 0; i < 20; i++) EXPECT_FALSE(health.picture(i % 3 ? kSome : kAll)) << i;
  for (int i = 0; i < 3; i++) health.picture(kSome);
  EXPECT_EQ(health.out_of_service(), CameraSet{1});
  for (int i = 0; i < 20; i++) EXPECT_FALSE(health.picture(i % 3 ? kAll : kSome)) << i;
}

TEST(CameraHealth, OnlyKnownCamerasAreMissed) {
  CameraHealth without_rig(1), with_rig(1);
  with_rig.expect(4);
  for (int i = 0; i < 3; i++) {
    without_rig.picture(kSome);
    with_rig.picture(kSome);
  }
  EXPECT_TRUE(without_rig.out_of_service().empty());
  EXPECT_EQ(with_rig.out_of_service(), CameraSet{1});
}

TEST(CameraHealth, PictureWithoutCamerasIsIgnored) {
  CameraHealth health(1);
  health.picture(kAll);
  for (int i = 0; i < 10; i++) EXPECT_FALSE(health.picture({}));
}

TEST(CameraHealth, LimitOfZeroTakesNoCameraOut) {
  CameraHealth health;
  health.expect(4);
  for (int i = 0; i < 100; i++) EXPECT_FALSE(health.picture(kSome));
}

TEST(CameraHealth, LateAnswerCountsForTheNextPicture) {
  CameraHealth health(1);
  health.picture(kAll);
  for (int i = 0; i < 10; i++) {
    health.add_late(0, CameraRanges(CameraSet{1}));
    EXPECT_FALSE(health.picture(kSome)) << i;
  }
  health.picture(kSome);
  EXPECT_TRUE(health.picture(kSome)) << "counts once";
}

TEST(CameraHealth, NewRigClearsTheState) {
  CameraHealth health(1);
  health.expect(4);
  EXPECT_FALSE(health.use_rig(7)) << "the first";
  for (int i = 0; i < 3; i++) health.picture(kSome);
  EXPECT_EQ(health.out_of_service(), CameraSet{1});
  EXPECT_FALSE(health.use_rig(0)) << "unknown";
  EXPECT_FALSE(health.use_rig(7));
  EXPECT_EQ(health.out_of_service(), CameraSet{1});
  EXPECT_TRUE(health.use_rig(8));
  EXPECT_TRUE(health.out_of_service().empty());
  EXPECT_FALSE(health.picture(kSome));
  EXPECT_TRUE(health.picture(kSome)) << "expected cameras are missing from the start";
  EXPECT_TRUE(health.use_rig(9));
  EXPECT_FALSE(health.use_rig(10)) << "no camera was out of service";
  health.add_late(9, CameraRanges(CameraSet{1}));
  EXPECT_FALSE(health.picture(kSome));
  EXPECT_TRUE(health.picture(kSome)) << "other rigs' cameras are ignored";
}

constexpr int64_t kEnough = SilenceDetector::kPatience;

TEST(SilenceDetector, OnlyRequestsOfOtherViewsAreReportedOnce) {
  SilenceDetector watch;
  EXPECT_FALSE(watch.request_of_other_view(1));
  EXPECT_FALSE(watch.request_of_other_view(kEnough));
  EXPECT_TRUE(watch.request_of_other_view(1 + kEnough));
  EXPECT_FALSE(watch.request_of_other_view(2 + 2 * kEnough));
  watch.clear();
  EXPECT_FALSE(watch.request_of_other_view(3 * kEnough)) << "restarted";
  watch.asked();
  EXPECT_FALSE(watch.request_of_other_view(9 * kEnough)) << "requests arrive";
}

TEST(SilenceDetector, ViewWithoutAnswersIsReportedOnce) {
  SilenceDetector watch;
  EXPECT_FALSE(watch.composed(1));
  EXPECT_FALSE(watch.composed(kEnough));
  EXPECT_TRUE(watch.composed(1 + kEnough));
  EXPECT_FALSE(watch.composed(2 + 2 * kEnough));
  watch.clear();
  EXPECT_FALSE(watch.composed(3 * kEnough));
  watch.answered();
  EXPECT_FALSE(watch.composed(9 * kEnough));
}

TEST(SilenceDetector, SilentNodesAreReportedOnceEachTime) {
  SilenceDetector watch;
  int64_t now = 1;
  const auto reported_in = [&](int steps) {
    int told = 0;
    for (int i = 0; i < steps; i++) told += watch.composed(now += kEnough / 10);
    return told;
  };
  watch.answered();
  EXPECT_EQ(reported_in(10), 0);
  EXPECT_EQ(reported_in(30), 1);
  EXPECT_TRUE(watch.ever_answered());
  watch.answered();
  EXPECT_EQ(reported_in(10), 0) << "answers again";
  EXPECT_EQ(reported_in(30), 1) << "silent again";
  watch.answered();
  EXPECT_EQ(reported_in(5), 0);
  now += 100 * kEnough;
  EXPECT_EQ(reported_in(9), 0) << "a pause does not count";
}

}  // namespace
}  // namespace lf
