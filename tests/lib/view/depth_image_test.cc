// SPDX-License-Identifier: LGPL-2.1-or-later
#include "view/depth_image.h"

#include <opencv2/imgcodecs.hpp>

#include "base/file.h"
#include "support/expect_error.h"
#include "support/rigs.h"
#include "support/temp_dir.h"
#include "support/test.h"

namespace lf {
namespace {

View test_view() {
  return {37,
          23,
          Lens(LensModel::kRadial, {40, 17, 12, -0.1, 0.01}),
          {{0.3, -0.2, -0.5}, glm::normalize(Quat(1, 0.1, -0.2, 0.05))},
          {plane_through({0, 0, 2}, glm::normalize(Vec3(0.2, 0.1, 1)))}};
}

Vec3 point_at(const View& view, int x, int y, double depth) {
  return view.pose.position + view.pose.rotation() * (Vec3(view.lens.unproject(Vec2(x, y)).value(), 1) * depth);
}

TEST(DepthImage, PointsAreOnTheFocalPlane) {
  const View view = test_view();
  const DepthImage image = depth_image(view);
  ASSERT_EQ(image.depths.size(), static_cast<size_t>(view.width) * view.height);
  for (int y = 0; y < view.height; y++)
    for (int x = 0; x < view.width; x++) {
      const double depth = image.depths[static_cast<size_t>(y) * view.width + x];
      ASSERT_GT(depth, 0);
      EXPECT_LT(std::abs(view.focus.plane.signed_distance(point_at(view, x, y, depth))), 1e-6 * depth);
    }
}

TEST(DepthImage, PointsMatchTheMap) {
  View view = test_view();
  FocalMap map = FocalMap::for_view(view.width, view.height);
  map.from = plane_through({0, 0, -1}, glm::normalize(Vec3(-0.1, 0.05, 1)));
  map.nearest = 0.8;
  map.farthest = 0.1;
  std::mt19937 random(7);
  for (int i = 0; i < map.columns * map.rows; i++) map.levels.push_back(static_cast<uint8_t>(random()));
  view.focus.map = std::make_shared<FocalMap>(map);
  const DepthImage image = depth_image(view);
  for (int y = 0; y < view.height; y++)
    for (int x = 0; x < view.width; x++) {
      const double depth = image.depths[static_cast<size_t>(y) * view.width + x];
      const double expected = 1 / map.inverse_at(x, y);
      EXPECT_NEAR(map.from.signed_distance(point_at(view, x, y, depth)), expected, 1e-6 * expected) << x << " " << y;
    }
}

TEST(DepthImage, InfinityIsAValidDepth) {
  View view = test_view();
  view.focus.map =
      test::level_surface(view.width, view.height, 0, 1, 0, plane_through(view.pose.position, view.pose.forward()));
  EXPECT_EQ(depth_image(view).depths[5], std::numeric_limits<float>::infinity());
}

TEST(DepthImage, DepthsAreUnknownWithoutCoverageAndBehindTheView) {
  View view = test_view();
  std::vector<float> coverage(static_cast<size_t>(view.width) * view.height, 0.5f);
  coverage[40] = 0;
  const DepthImage image = depth_image(view, coverage);
  EXPECT_EQ(image.depths[40], 0);
  EXPECT_GT(image.depths[41], 0);
  view.focus.plane = plane_through({0, 0, -3}, {0, 0, 1});
  for (const float depth : depth_image(view).depths) EXPECT_EQ(depth, 0);
}

}  // namespace
}  // namespace lf
