// SPDX-License-Identifier: LGPL-2.1-or-later
#include "composite/disjoint_rects.h"

#include <gtest/gtest.h>

#include <random>

namespace lf {
namespace {

// Beside looking at every pixel, for as many rectangles as fit and for those that do not.
TEST(DisjointRects, NoTwoMeet) {
  constexpr int kWidth = 300, kHeight = 200;
  std::mt19937 random(3);
  for (const int largest : {4, 20, 150}) {
    DisjointRects rects;
    std::vector<bool> taken(kWidth * kHeight);
    size_t added = 0;
    for (int i = 0; i < 3000; i++) {
      const int x = static_cast<int>(random() % kWidth), y = static_cast<int>(random() % kHeight);
      const Rect rect{x, y, std::min(kWidth, x + 1 + static_cast<int>(random() % largest)),
                      std::min(kHeight, y + 1 + static_cast<int>(random() % largest))};
      bool meets = false;
      for (int v = rect.y0; v < rect.y1; v++)
        for (int u = rect.x0; u < rect.x1; u++) meets = meets || taken[static_cast<size_t>(v * kWidth + u)];
      ASSERT_EQ(rects.meets(rect), meets) << i;
      ASSERT_EQ(rects.add(rect), !meets) << i;
      if (meets) continue;
      added++;
      for (int v = rect.y0; v < rect.y1; v++)
        for (int u = rect.x0; u < rect.x1; u++) taken[static_cast<size_t>(v * kWidth + u)] = true;
    }
    EXPECT_EQ(rects.rects().size(), added);
    EXPECT_TRUE(largest == 150 || added > DisjointRects::kFew);
  }
}

TEST(DisjointRects, AsManyAsAnAnswerCanHaveAreSoonAdded) {
  DisjointRects rects;
  for (int i = 0; i < 65536; i++) ASSERT_TRUE(rects.add({i % 256 * 4, i / 256 * 4, i % 256 * 4 + 4, i / 256 * 4 + 4}));
  for (int i = 0; i < 65536; i++) ASSERT_TRUE(rects.meets({i % 256 * 4, 0, i % 256 * 4 + 1, 2000}));
  EXPECT_FALSE(rects.meets({1024, 0, 2000, 2000}));
  EXPECT_FALSE(rects.meets({0, 1024, 2000, 2000}));
}

}  // namespace
}  // namespace lf
