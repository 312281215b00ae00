// SPDX-License-Identifier: LGPL-2.1-or-later
#include "composite/past_requests.h"

#include <gtest/gtest.h>

namespace lf {
namespace {

using Answer = PastRequests::Answer;

TEST(PastRequests, AnAnswerIsInTimeUpToTheDeadlineOfItsRequest) {
  PastRequests past;
  for (uint32_t i = 0; i < 3; i++) {
    EXPECT_FALSE(past.begin(i));
    past.composed(i, 100 * (i + 1));
  }
  EXPECT_EQ(past.judge(1, 200), Answer::kInTime);
  EXPECT_EQ(past.judge(1, 201), Answer::kLate);
  EXPECT_EQ(past.judge(2, 1000), Answer::kInTime) << "nobody knows since when that of the latest has been there";
  EXPECT_EQ(past.judge(77, 0), Answer::kLate) << "not known";
}

TEST(PastRequests, AnAnswerToWhatWasLeftOutSaysNothing) {
  PastRequests past;
  past.skipped(4);
  past.composed(5, 10);
  EXPECT_EQ(past.judge(4, 0), Answer::kToSkipped);
  EXPECT_EQ(past.judge(5, 0), Answer::kInTime);
}

TEST(PastRequests, ForgetsTheOldest) {
  PastRequests past;
  const auto most = static_cast<uint32_t>(PastRequests::kMost);
  for (uint32_t i = 0; i <= most; i++) {
    past.composed(2 * i, ~uint64_t{0});
    past.skipped(2 * i + 1);
  }
  EXPECT_EQ(past.judge(0, 0), Answer::kLate);
  EXPECT_EQ(past.judge(1, 0), Answer::kLate);
  EXPECT_EQ(past.judge(2, 0), Answer::kInTime);
  EXPECT_EQ(past.judge(3, 0), Answer::kToSkipped);
}

TEST(PastRequests, AViewerThatBeginsAnewIsNoticedThoughNumbersWrap) {
  PastRequests past;
  EXPECT_FALSE(past.begin(0xffffffff));
  past.composed(0xffffffff, 10);
  EXPECT_FALSE(past.begin(0)) << "the next number";
  EXPECT_EQ(past.judge(0xffffffff, 10), Answer::kInTime);
  past.composed(0, 20);
  EXPECT_FALSE(past.begin(0)) << "the same once more";
  EXPECT_FALSE(past.begin(900));
  EXPECT_TRUE(past.begin(0));
  EXPECT_EQ(past.judge(0, 0), Answer::kLate);
  past.clear();
  EXPECT_FALSE(past.begin(900));
}

}  // namespace
}  // namespace lf
