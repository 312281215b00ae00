// SPDX-License-Identifier: LGPL-2.1-or-later
#include "serve/pace.h"

#include <gtest/gtest.h>

namespace lf::serve {
namespace {

TEST(Pace, MakesNoMoreThanAreAnswered) {
  Pace pace(2);
  EXPECT_TRUE(pace.begin(100));
  EXPECT_TRUE(pace.begin(200));
  EXPECT_FALSE(pace.begin(300));
  pace.end(100);
  EXPECT_TRUE(pace.begin(400));
  EXPECT_DOUBLE_EQ(pace.kept(), 3.0 / 4);
  EXPECT_DOUBLE_EQ(pace.kept(), 1) << "none was wanted since";
}

TEST(Pace, WhatBecomesNoPictureIsNotWaitedForLong) {
  Pace pace(1);
  EXPECT_TRUE(pace.begin(100));
  EXPECT_FALSE(pace.begin(100 + Pace::kPatience));
  EXPECT_TRUE(pace.begin(101 + Pace::kPatience));
}

TEST(Pace, LeavesOutWhatIsTooSoon) {
  Pace pace(9);
  pace.set_interval(50);
  EXPECT_TRUE(pace.begin(100));
  EXPECT_FALSE(pace.begin(149));
  EXPECT_TRUE(pace.begin(150));
  EXPECT_DOUBLE_EQ(pace.kept(), 1) << "that one was not wanted";
}

// Also where there is room by the time that the other eye's request comes, or where it would be too soon by itself.
TEST(Pace, BothEyesAreAskedForOrNone) {
  Pace pace(1);
  pace.set_interval(50);
  EXPECT_TRUE(pace.begin(100));
  EXPECT_TRUE(pace.begin(100));
  EXPECT_FALSE(pace.begin(200));
  pace.end(100);
  EXPECT_FALSE(pace.begin(200));
  EXPECT_TRUE(pace.begin(300));
  EXPECT_TRUE(pace.begin(300));
  EXPECT_DOUBLE_EQ(pace.kept(), 2.0 / 3) << "a pair is one picture";
}

}  // namespace
}  // namespace lf::serve
