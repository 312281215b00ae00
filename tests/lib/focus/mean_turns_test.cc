// SPDX-License-Identifier: LGPL-2.1-or-later
#include "focus/mean_turns.h"

#include <gtest/gtest.h>

namespace lf {
namespace {

TEST(MeanTurns, EveryThirdRequestWithTrialsAsks) {
  MeanTurns turns;
  bool asked = false;
  for (int i = 0; i < 30; i++) {
    EXPECT_FALSE(turns.next(false, asked)) << "without trials";
    asked = turns.next(true, false);
    EXPECT_EQ(asked, i % 3 == 0) << i;
  }
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
