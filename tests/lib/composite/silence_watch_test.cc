// SPDX-License-Identifier: LGPL-2.1-or-later
#include "composite/silence_watch.h"

#include <gtest/gtest.h>

namespace lf {
namespace {

constexpr int64_t kEnough = SilenceWatch::kPatience;

TEST(SilenceWatch, RequestsOfOtherViewsAloneAreToldOfOnce) {
  SilenceWatch watch;
  EXPECT_FALSE(watch.others_asked(1));
  EXPECT_FALSE(watch.others_asked(kEnough));
  EXPECT_TRUE(watch.others_asked(1 + kEnough));
  EXPECT_FALSE(watch.others_asked(2 + 2 * kEnough));
  watch.clear();
  EXPECT_FALSE(watch.others_asked(3 * kEnough)) << "it begins anew";
  watch.asked();
  EXPECT_FALSE(watch.others_asked(9 * kEnough)) << "somebody asks";
}

TEST(SilenceWatch, AViewThatNobodyAnswersIsToldOfOnce) {
  SilenceWatch watch;
  EXPECT_FALSE(watch.composed(1));
  EXPECT_FALSE(watch.composed(kEnough));
  EXPECT_TRUE(watch.composed(1 + kEnough));
  EXPECT_FALSE(watch.composed(2 + 2 * kEnough));
  watch.clear();
  EXPECT_FALSE(watch.composed(3 * kEnough));
  watch.answered();
  EXPECT_FALSE(watch.composed(9 * kEnough));
}

TEST(SilenceWatch, NodesThatFallSilentAreToldOfOnceEachTime) {
  SilenceWatch watch;
  int64_t now = 1;
  const auto told_in = [&](int steps) {
    int told = 0;
    for (int i = 0; i < steps; i++) told += watch.composed(now += kEnough / 10);
    return told;
  };
  watch.answered();
  EXPECT_EQ(told_in(10), 0);
  EXPECT_EQ(told_in(30), 1);
  EXPECT_TRUE(watch.ever_answered());
  watch.answered();
  EXPECT_EQ(told_in(10), 0) << "they are back";
  EXPECT_EQ(told_in(30), 1) << "and gone again";
  watch.answered();
  EXPECT_EQ(told_in(5), 0);
  now += 100 * kEnough;
  EXPECT_EQ(told_in(9), 0) << "a pause is no silence";
}

}  // namespace
}  // namespace lf
