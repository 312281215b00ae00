// SPDX-License-Identifier: LGPL-2.1-or-later
#include "composite/latency_control.h"

#include "support/test.h"

namespace lf {
namespace {

// A compositor whose nodes all take the same time for an answer.
class LatencyControlTest : public testing::Test {
 protected:
  static constexpr uint64_t kSet = 60;
  // Makes pictures with answers after `delay`.
  void run(uint64_t delay, unsigned pictures) {
    for (unsigned i = 0; i < pictures; i++) {
      const bool in_time = delay <= latency_;
      const std::optional<uint64_t> spare = in_time ? std::optional(latency_ - delay) : std::nullopt;
      latency_ = control_.next(latency_, in_time, spare);
      if (!in_time) control_.add_late_answer();
    }
  }
  LatencyControl control_;
  uint64_t latency_ = kSet;
};

TEST_F(LatencyControlTest, IncreasesUntilAnswersAreInTime) {
  run(40, 100);
  EXPECT_EQ(latency_, kSet);
  run(200, 100);
  EXPECT_GE(latency_, 200u);
  EXPECT_LT(latency_, 1.5 * 200);
}

TEST_F(LatencyControlTest, AnOverloadedNodeAnswersFewPictures) {
  for (int i = 0; i < 600; i++) {
    latency_ = control_.next(latency_, false, std::nullopt);
    if (i % 3 == 0) control_.add_late_answer();
  }
  EXPECT_EQ(latency_, static_cast<uint64_t>(LatencyControl::kMost * kSet));
}

TEST_F(LatencyControlTest, HasALimit) {
  run(5'000, 1'000);
  EXPECT_EQ(latency_, static_cast<uint64_t>(LatencyControl::kMost * kSet));
}

TEST_F(LatencyControlTest, DecreasesWhenAnswersAreEarly) {
  run(200, 100);
  run(30, LatencyControl::kEarlyPictures - 1);
  EXPECT_GE(latency_, 200u) << "not yet";
  run(30, 10 * LatencyControl::kEarlyPictures);
  EXPECT_EQ(latency_, kSet) << "not below the value of the application";
}

TEST_F(LatencyControlTest, DoesNotDecreaseIfAnswersWouldBeLate) {
  run(200, 100);
  const uint64_t found = latency_;
  run(200, 2'000);
  EXPECT_EQ(latency_, found);
  run(static_cast<uint64_t>(static_cast<double>(found) / 1.55), 2'000);
  EXPECT_EQ(latency_, found) << "without a reserve";
}

TEST_F(LatencyControlTest, SomeLatePicturesPreventADecrease) {
  run(200, 100);
  const uint64_t found = latency_;
  for (int i = 0; i < 50; i++) {
    run(30, LatencyControl::kEarlyPictures / 2);
    run(found + 1, 1);
  }
  EXPECT_EQ(latency_, found);
}

TEST_F(LatencyControlTest, AbsentAnswersAreNotLate) {
  for (int i = 0; i < 1'000; i++) latency_ = control_.next(latency_, false, std::nullopt);
  EXPECT_EQ(latency_, kSet) << "the nodes do not work";
  for (int i = 0; i < 1'000; i++) {
    latency_ = control_.next(latency_, true, std::nullopt);
    control_.add_late_answer();
  }
  EXPECT_EQ(latency_, kSet) << "another node answers in time";
}

TEST_F(LatencyControlTest, TheApplicationMayChangeTheLatency) {
  run(200, 100);
  latency_ = 100;
  run(40, 10 * LatencyControl::kEarlyPictures);
  EXPECT_EQ(latency_, 100u);
  EXPECT_FALSE(control_.clear());
}

TEST_F(LatencyControlTest, ClearReturnsTheValueOfTheApplication) {
  EXPECT_FALSE(control_.clear());
  run(200, 100);
  EXPECT_EQ(control_.clear(), kSet);
  EXPECT_FALSE(control_.clear());
}

}  // namespace
}  // namespace lf
