// SPDX-License-Identifier: LGPL-2.1-or-later
#include "render/camera_weights.h"

#include <gtest/gtest.h>

#include "reference/generators.h"

namespace lf {
namespace {

constexpr int kWidth = 45, kHeight = 33;

TEST(BlendGrid, SumsToOneToTheBitAndIsBilinear) {
  constexpr CameraIndex kCameras = 100;
  reference::Random random(1);
  BlendGrid grid(kWidth, kHeight, kCameras);
  std::vector<std::vector<double>> points;  // of all cameras, normalised
  while (points.size() < static_cast<size_t>(grid.columns()) * grid.rows()) {
    std::vector<double> weights(kCameras);
    std::vector<BlendGrid::Share> shares;
    double sum = 0;
    for (CameraIndex i = 0; i < kCameras && shares.size() < BlendGrid::kMaxShares; i++) {
      if (random.one_in(3)) continue;
      shares.push_back({i, random.uniform(0, 1) / (i + 1)});
      sum += weights[i] = shares.back().weight;
    }
    for (double& w : weights) w /= sum;
    points.push_back(weights);
    grid.add_point(shares);
  }
  for (int y = 0; y < kHeight; y++)
    for (int x = 0; x < kWidth; x++) {
      int sum = 0;
      for (CameraIndex i = 0; i < kCameras; i++) {
        const int weight = grid.weight(i, x, y);
        ASSERT_GE(weight, 0);
        sum += weight;
        const size_t at = static_cast<size_t>(y / BlendGrid::kStep) * grid.columns() + x / BlendGrid::kStep;
        const double right = x % BlendGrid::kStep / 16., down = y % BlendGrid::kStep / 16.;
        const double expected =
            (1 - down) * ((1 - right) * points[at][i] + right * points[at + 1][i]) +
            down * ((1 - right) * points[at + grid.columns()][i] + right * points[at + grid.columns() + 1][i]);
        // Two running sums, each rounded at the points and once more.
        ASSERT_NEAR(weight, expected * BlendGrid::kOne, 2);
        if (weight > 0) {
          const Rect rect = grid.camera_rect(i);
          ASSERT_TRUE(x >= rect.x0 && x < rect.x1 && y >= rect.y0 && y < rect.y1);
        }
      }
      ASSERT_EQ(sum, BlendGrid::kOne);
    }
}

TEST(BlendGrid, OneCameraHasItAll) {
  BlendGrid grid(1, 1, 3);
  const BlendGrid::Share share{2, 1e-300};
  for (int i = 0; i < grid.columns() * grid.rows(); i++) grid.add_point({&share, 1});
  EXPECT_EQ(grid.weight(2, 0, 0), BlendGrid::kOne);
  EXPECT_EQ(grid.camera_rect(2), (Rect{0, 0, 1, 1}));
  EXPECT_TRUE(grid.camera_rect(0).empty());
}

TEST(BlendGrid, ACameraIsBoundedByThePointsBesideItsOwn) {
  BlendGrid grid(100, 50, 2);
  for (int j = 0; j < grid.rows(); j++)
    for (int i = 0; i < grid.columns(); i++) {
      const BlendGrid::Share shares[] = {{0, 1}, {1, i == 3 && j == 1 ? 0.5 : 0}};
      grid.add_point(shares);
    }
  EXPECT_EQ(grid.camera_rect(1), (Rect{33, 1, 64, 32}));
  EXPECT_EQ(grid.weight(1, 48, 16), (BlendGrid::kOne + 2) / 3);
  EXPECT_EQ(grid.weight(1, 32, 16), 0);
  BlendGrid::Cell cell;
  EXPECT_FALSE(grid.find(1, 0, 0, cell));
}

}  // namespace
}  // namespace lf
