// SPDX-License-Identifier: LGPL-2.1-or-later
#include "rig/predicates.h"

#include <gtest/gtest.h>

namespace lf {
namespace {

constexpr int32_t kM = kMaxCoordinate;

TEST(Predicates, OrientationIsTwiceTheSignedAreaAtFullRange) {
  EXPECT_EQ(orientation({0, 0}, {1, 0}, {0, 1}), 1);
  EXPECT_EQ(orientation({-kM, -kM}, {kM, -kM}, {kM, kM}), int64_t{2 * kM} * 2 * kM);
  EXPECT_EQ(orientation({-kM, -kM}, {kM, kM}, {kM, -kM}), int64_t{-2 * kM} * 2 * kM);
  // A hair off a diagonal of the full range: doubles of the products would still tell, floats would not.
  EXPECT_EQ(orientation({-kM, -kM}, {0, 0}, {kM, kM}), 0);
  EXPECT_EQ(orientation({-kM, -kM}, {0, 0}, {kM - 1, kM}), kM);
}

TEST(Predicates, InCircleIsExactAtFullRange) {
  EXPECT_EQ(in_circle({-kM, -kM}, {kM, -kM}, {kM, kM}, {-kM, kM}), 0);
  EXPECT_EQ(in_circle({-kM, -kM}, {kM, -kM}, {kM, kM}, {-kM + 1, kM}), 1);
  EXPECT_EQ(in_circle({-kM, -kM}, {kM, -kM}, {kM - 1, kM}, {-kM, kM}), -1);
  EXPECT_EQ(in_circle({-kM, -kM}, {kM, -kM}, {kM, kM}, {0, 0}), 1);
}

TEST(Predicates, ClosedTriangleHasItsBorder) {
  EXPECT_TRUE(in_closed_triangle({0, 0}, {4, 0}, {0, 4}, {1, 1}));
  EXPECT_TRUE(in_closed_triangle({0, 0}, {4, 0}, {0, 4}, {2, 2}));
  EXPECT_TRUE(in_closed_triangle({0, 0}, {4, 0}, {0, 4}, {4, 0}));
  EXPECT_FALSE(in_closed_triangle({0, 0}, {4, 0}, {0, 4}, {3, 2}));
}

TEST(Predicates, TouchingSegmentsDoNotCross) {
  EXPECT_TRUE(cross_properly({0, 0}, {4, 4}, {0, 4}, {4, 0}));
  EXPECT_FALSE(cross_properly({0, 0}, {4, 4}, {2, 2}, {4, 0}));
  EXPECT_FALSE(cross_properly({0, 0}, {4, 4}, {4, 4}, {4, 0}));
  EXPECT_FALSE(cross_properly({0, 0}, {4, 4}, {1, 1}, {8, 8}));
  EXPECT_FALSE(cross_properly({0, 0}, {4, 4}, {9, 0}, {0, 9}));
}

}  // namespace
}  // namespace lf
