// SPDX-License-Identifier: LGPL-2.1-or-later
#include "composite/coverage.h"

#include <gtest/gtest.h>

namespace lf {
namespace {

const CameraRanges kRow(CameraSet{4, 5, 6, 7});

TEST(Coverage, ACameraMayComeInStripsButNotTwice) {
  Coverage coverage;
  EXPECT_TRUE(coverage.add(3, {0, 0, 10, 4}));
  EXPECT_TRUE(coverage.add(3, {0, 4, 10, 8}));
  EXPECT_FALSE(coverage.add(3, {9, 7, 12, 9}));
  EXPECT_TRUE(coverage.add(2, {9, 7, 12, 9}));
  EXPECT_TRUE(coverage.has(3));
  EXPECT_FALSE(coverage.has(4));
}

TEST(Coverage, ASumStandsForItsCameras) {
  Coverage coverage;
  EXPECT_TRUE(coverage.add(kRow, {0, 0, 10, 4}));
  EXPECT_FALSE(coverage.add(5, {5, 0, 20, 4}));
  EXPECT_TRUE(coverage.add(5, {5, 4, 20, 8}));
  EXPECT_TRUE(coverage.add(8, {0, 0, 10, 4}));
  EXPECT_FALSE(coverage.add(CameraRanges(CameraSet{7, 9}), {0, 3, 1, 9}));
  EXPECT_FALSE(coverage.add(CameraRanges(CameraSet{5, 9}), {5, 6, 6, 9}));
  EXPECT_TRUE(coverage.add(CameraRanges(CameraSet{6, 9}), {5, 6, 6, 9}));
  EXPECT_TRUE(coverage.has(6));
  coverage.clear();
  EXPECT_FALSE(coverage.has(6));
  EXPECT_TRUE(coverage.add(5, {5, 0, 20, 4}));
}

TEST(Coverage, TakesOutWhatHasCome) {
  Coverage coverage;
  coverage.add(kRow, {0, 0, 4, 1});
  coverage.add(5, {3, 1, 9, 2});
  std::vector<float> own(4 * 3, 0.5f);
  coverage.take_out(5, {2, 0, 6, 3}, own);
  const float x = 0.5f;
  EXPECT_EQ(own, (std::vector<float>{0, 0, x, x, x, 0, 0, 0, x, x, x, x}));
  coverage.take_out(1, {2, 0, 6, 3}, own);
  EXPECT_EQ(own[2], x);
}

}  // namespace
}  // namespace lf
