// SPDX-License-Identifier: LGPL-2.1-or-later
#include "focus/mean_turns.h"

#include <gtest/gtest.h>

#include <vector>

namespace lf {
namespace {

TEST(MeanTurns, TheFirstRequestsWithTrialsAskAndThenFewerAndFewer) {
  MeanTurns turns;
  std::vector<int> asking;
  bool asked = false;
  for (int i = 1; i <= 120; i++) {
    EXPECT_FALSE(turns.next(false, asked)) << "without trials";
    asked = turns.next(true, false);
    if (asked) asking.push_back(i);
  }
  EXPECT_EQ(asking, (std::vector<int>{1, 2, 3, 4, 6, 10, 18, 34, 66, 98}));
}

TEST(MeanTurns, OneIsAwaitedAtATime) {
  MeanTurns turns;
  EXPECT_TRUE(turns.next(true, false));
  for (int i = 0; i < 10; i++) EXPECT_FALSE(turns.next(true, false)) << i;
  EXPECT_TRUE(turns.next(true, true));
}

TEST(MeanTurns, WhatIsLostIsAskedForAgain) {
  MeanTurns turns;
  for (unsigned i = 0; i < 3 * MeanTurns::kPatience; i++)
    EXPECT_EQ(turns.next(true, false), i % MeanTurns::kPatience == 0) << i;
}

}  // namespace
}  // namespace lf
