// SPDX-License-Identifier: LGPL-2.1-or-later
#include "rig/triangle.h"

#include <gtest/gtest.h>

namespace lf {
namespace {

TEST(Triangle, LowestFirstKeepsTheTurn) {
  EXPECT_EQ(lowest_first({1, 2, 3}), (Triangle{1, 2, 3}));
  EXPECT_EQ(lowest_first({3, 1, 2}), (Triangle{1, 2, 3}));
  EXPECT_EQ(lowest_first({2, 3, 1}), (Triangle{1, 2, 3}));
  EXPECT_EQ(lowest_first({3, 2, 1}), (Triangle{1, 3, 2}));
  EXPECT_EQ(lowest_first({5, 4, 4}), (Triangle{4, 4, 5}));
}

}  // namespace
}  // namespace lf
