// SPDX-License-Identifier: LGPL-2.1-or-later
#include "rig/camera_ranges.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <random>

namespace lf {
namespace {

TEST(CameraRanges, NeighboursAreOneRange) {
  const CameraRanges ranges(CameraSet{0, 1, 2, 7, 9, 10});
  EXPECT_EQ(ranges.ranges(), (std::vector<CameraRange>{{0, 2}, {7, 7}, {9, 10}}));
  EXPECT_EQ(ranges.size(), 6u);
  EXPECT_EQ(ranges.cameras(), (CameraSet{0, 1, 2, 7, 9, 10}));
  EXPECT_TRUE(CameraRanges(CameraSet{}).empty());
}

TEST(CameraRanges, AppendsBeyondTheOthersWithAGap) {
  CameraRanges ranges;
  EXPECT_TRUE(ranges.append({3, 5}));
  EXPECT_FALSE(ranges.append({6, 7}));  // touches
  EXPECT_FALSE(ranges.append({5, 7}));
  EXPECT_FALSE(ranges.append({0, 1}));
  EXPECT_FALSE(ranges.append({9, 8}));
  EXPECT_TRUE(ranges.append({7, 7}));
  EXPECT_EQ(ranges.cameras(), (CameraSet{3, 4, 5, 7}));
}

// Against sorted vectors.
TEST(CameraRanges, AreSets) {
  std::mt19937 random(1);
  for (int i = 0; i < 2000; i++) {
    const auto some = [&random] {
      CameraSet set;
      const int one_in = 1 + static_cast<int>(random() % 4);
      for (CameraIndex camera = 0; camera < 24; camera++)
        if (random() % one_in == 0) set.push_back(camera);
      return set;
    };
    const CameraSet a = some(), b = some();
    const CameraRanges ra(a), rb(b);
    CameraSet both, left, common;
    std::ranges::set_union(a, b, std::back_inserter(both));
    std::ranges::set_difference(a, b, std::back_inserter(left));
    std::ranges::set_intersection(a, b, std::back_inserter(common));
    CameraRanges sum = ra, difference = ra;
    sum.add(rb);
    difference.remove(rb);
    EXPECT_EQ(sum, CameraRanges(both));
    EXPECT_EQ(difference, CameraRanges(left));
    EXPECT_EQ(ra.intersects(rb), !common.empty());
    EXPECT_EQ(ra.contains(rb), common.size() == b.size());
    for (CameraIndex camera = 0; camera < 26; camera++)
      EXPECT_EQ(ra.contains(camera), std::ranges::binary_search(a, camera));
  }
}

}  // namespace
}  // namespace lf
