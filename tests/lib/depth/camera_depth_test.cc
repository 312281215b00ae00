// SPDX-License-Identifier: LGPL-2.1-or-later
#include "depth/camera_depth.h"

#include <algorithm>
#include <cmath>
#include <utility>
#include <vector>

#include "lib/focus/array_of_walls.h"
#include "reference/generators.h"
#include "support/test.h"

namespace lf {
namespace {

class CameraDepthTest : public testing::Test {
 protected:
  CameraDepthTest() {
    for (CameraIndex i = 0; i < walls_.rig.cameras.size(); i++)
      images_.push_back(matching_image(walls_.rig.cameras[i], walls_.images[i].view(), 1));
  }
  std::vector<const MatchingImage*> neighbours_of(size_t camera) const {
    std::vector<const MatchingImage*> neighbours;
    for (size_t i = 0; i < images_.size(); i++)
      if (i != camera) neighbours.push_back(&images_[i]);
    return neighbours;
  }
  double true_inverse(size_t camera, int x, int y) const {
    const MatchingImage& image = images_[camera];
    const Vec3 near = image.pose.position + image.pose.rotation() * (1.5 * image.ray(x, y));
    return near.x > 0 ? 1 / 1.5 : 1 / 3.;
  }
  // Returns the share of pixels with a depth error of at most half a step.
  double share_right(size_t camera, const CameraDepth& depth) const {
    const MatchingImage& image = images_[camera];
    int right = 0;
    for (int y = 0; y < image.height; y++)
      for (int x = 0; x < image.width; x++)
        right += std::abs(depth.inverse[static_cast<size_t>(y) * image.width + x] - true_inverse(camera, x, y)) <
                 kSweep.step() / 2;
    return right / static_cast<double>(image.size());
  }

  static constexpr DepthSweep kSweep{.farthest = 0.2, .nearest = 0.9, .planes = 24};
  const test::ArrayOfWalls walls_;
  std::vector<MatchingImage> images_;
};

TEST_F(CameraDepthTest, FindsBothWalls) {
  for (const size_t camera : {size_t{4}, size_t{0}, size_t{5}})
    EXPECT_GT(share_right(camera, estimate_depth(images_[camera], neighbours_of(camera), kSweep)), 0.93) << camera;
}

TEST_F(CameraDepthTest, OneNeighbourIsEnoughWhereItSeesThePoint) {
  const MatchingImage* const one[] = {&images_[5]};
  EXPECT_GT(share_right(4, estimate_depth(images_[4], one, kSweep)), 0.8);
}

TEST_F(CameraDepthTest, WithoutNeighboursEverythingIsFar) {
  const CameraDepth depth = estimate_depth(images_[4], {}, kSweep);
  ASSERT_EQ(depth.inverse.size(), images_[4].size());
  for (const float inverse : depth.inverse) EXPECT_FLOAT_EQ(inverse, static_cast<float>(kSweep.farthest));
}

TEST_F(CameraDepthTest, DepthsStayInTheRange) {
  const CameraDepth depth =
      estimate_depth(images_[4], neighbours_of(4), {.farthest = 0.4, .nearest = 0.5, .planes = 3});
  for (const float inverse : depth.inverse) {
    EXPECT_GE(inverse, 0.4f);
    EXPECT_LE(inverse, 0.5f);
  }
}

// without_outliers() as its documentation says, in double precision. Pixels beyond the border repeat the border in the
// median, and do not agree with anything.
double plain_without_outliers(const std::vector<float>& inverse, int width, int height, int x, int y, double step) {
  const auto at = [&](int u, int v) -> double {
    return inverse[static_cast<size_t>(std::clamp(v, 0, height - 1)) * width + std::clamp(u, 0, width - 1)];
  };
  std::vector<double> around;
  int agreeing = 0;
  for (int k = 0; k < 9; k++) {
    const int u = x + k % 3 - 1, v = y + k / 3 - 1;
    around.push_back(at(u, v));
    const bool is_neighbour = (u != x || v != y) && u >= 0 && v >= 0 && u < width && v < height;
    agreeing += is_neighbour && std::abs(at(u, v) - at(x, y)) < 1.5 * step;
  }
  std::ranges::sort(around);
  return agreeing >= 2 ? at(x, y) : around[4];
}

TEST_F(CameraDepthTest, OutliersBecomeTheMedianOfTheirNeighbours) {
  constexpr double kStep = 0.01;
  const std::pair<int, int> sizes[] = {{1, 1}, {1, 9}, {9, 1}, {2, 2}, {3, 5}, {40, 31}, {67, 20}};
  reference::Random random(3);
  int replaced = 0;
  for (const auto& [width, height] : sizes) {
    std::vector<float> inverse;
    for (int i = 0; i < width * height; i++)
      inverse.push_back(static_cast<float>(random.integer(0, 3) == 0 ? random.uniform(0, 1) : random.uniform(0, 0.05)));
    const std::vector<float> out = without_outliers(inverse, width, height, kStep);
    for (int y = 0; y < height; y++)
      for (int x = 0; x < width; x++) {
        const size_t i = static_cast<size_t>(y) * width + x;
        EXPECT_EQ(out[i], plain_without_outliers(inverse, width, height, x, y, kStep)) << x << ", " << y;
        replaced += out[i] != inverse[i];
      }
  }
  EXPECT_GT(replaced, 100);
}

TEST_F(CameraDepthTest, ConfidenceIsTheShareOfAgreeingNeighbours) {
  std::vector<CameraDepth> depths(2);
  for (size_t camera = 0; camera < 2; camera++)
    for (int y = 0; y < images_[camera].height; y++)
      for (int x = 0; x < images_[camera].width; x++)
        depths[camera].inverse.push_back(static_cast<float>(true_inverse(camera, x, y)));
  const DepthNeighbour good{&images_[1], &depths[1]};
  CameraDepth farther = depths[1], nearer = depths[1];
  for (float& inverse : farther.inverse) inverse -= 0.3f;
  for (float& inverse : nearer.inverse) inverse += 0.3f;
  const DepthNeighbour sees_past{&images_[1], &farther}, hidden{&images_[1], &nearer};

  const auto mean = [&](std::vector<DepthNeighbour> neighbours) {
    double sum = 0;
    for (const float value : check_consistency(images_[0], depths[0], neighbours, kSweep.step())) sum += value;
    return sum / static_cast<double>(images_[0].size());
  };
  const double all = mean({good});
  EXPECT_GT(all, 0.85) << "the rest is outside of the neighbour's image, or hidden from it";
  EXPECT_LT(mean({sees_past}), 0.02);
  EXPECT_NEAR(mean({good, sees_past}), all / 2, 0.03);
  EXPECT_NEAR(mean({good, hidden}), all, 0.01) << "something nearer may hide the point";
  EXPECT_EQ(mean({}), 0);
}

}  // namespace
}  // namespace lf
