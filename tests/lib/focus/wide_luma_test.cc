// SPDX-License-Identifier: LGPL-2.1-or-later
#include "focus/wide_luma.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "base/error.h"
#include "image/gain.h"
#include "lib/focus/array_of_walls.h"

namespace lf {
namespace {

struct Wide {
  test::ArrayOfWalls walls{true};
  View view = mean_view(walls.view(60));
  WideLuma luma{walls.rig, walls.mesh, view, walls.own};
};

TEST(WideLuma, HasNodesTwiceAsFarApart) {
  const test::ArrayOfWalls walls;
  const View view = mean_view(walls.view(77));
  EXPECT_EQ(view.width, 20);
  EXPECT_EQ(view.height, 15);
  EXPECT_EQ(view.focus.map->levels, std::vector<uint8_t>(300, 77));
}

TEST(WideLuma, ManyCamerasAreCompared) {
  const Wide wide;
  EXPECT_EQ(wide.luma.cameras().size(), 9u);
  const WideLuma::Seen seen = wide.luma.see(wide.walls.sources(), {});
  ASSERT_EQ(seen.cameras.size(), 9u);
  EXPECT_EQ(seen.gains.mean(), 1);
  const Moments& m = seen.moments;
  const size_t middle = 7 * 20 + 10;
  EXPECT_GT(m.weight[middle], 0.5 * Moments::kWeightOne);
  const double mean = static_cast<double>(m.luma[middle]) / Moments::kLumaOne * Moments::kWeightOne / m.weight[middle];
  for (const WideLuma::Camera& camera : seen.cameras) EXPECT_NEAR(camera.luma[middle], mean, 2);
  // Gaussians around where the line of sight goes through the array: the eye is in its plane.
  const Vec3& eye = wide.view.pose.position;
  const Vec3& at = wide.walls.rig.cameras[seen.cameras[5].camera].pose.position;
  const double squared = glm::dot(at - eye, at - eye) / (kScenePitch * kScenePitch);
  EXPECT_NEAR(seen.cameras[5].weight[middle], WideLuma::kPeak * std::exp(-squared / 2), 1e-4);
}

TEST(WideLuma, FindsWhoIsBrighter) {
  Wide wide;
  constexpr CameraIndex kBright = 4;
  for (Image& image : wide.walls.images) std::ranges::fill(image.data(), 120);
  ByteBuffer memory;
  std::vector<Source> sources = wide.walls.sources();
  sources[kBright].image = divide_by_gain(sources[kBright].image, {0, 0, 160, 120}, 1 / 1.1f, memory);
  CameraGains gains;
  for (int round = 0; round < 6; round++) {
    const WideLuma::Seen seen = wide.luma.see(sources, gains);
    const std::vector<uint8_t> mean = mean_luma(seen.moments, seen.gains);
    for (const WideLuma::Camera& camera : seen.cameras)
      if (const std::optional<float> ratio = WideLuma::ratio(camera, mean)) gains.update(camera.camera, *ratio);
  }
  EXPECT_NEAR(gains.of(kBright), 1.1, 0.01) << "and does not take the others along";
  for (const CameraIndex other : {1, 5}) EXPECT_NEAR(gains.of(other), 1, 0.002);
  EXPECT_NEAR(wide.luma.see(sources, gains).gains.mean(), 1, 0.002) << "they do not wander off together";
}

TEST(WideLuma, PartsOfAnArrayAddUpToTheWhole) {
  const Wide wide;
  const WideLuma::Seen whole = wide.luma.see(wide.walls.sources(), {});
  const std::vector<CameraIndex> some{0, 1, 2, 3}, rest{4, 5, 6, 7, 8};
  WideLuma::Seen sum = WideLuma(wide.walls.rig, wide.walls.mesh, wide.view, some).see(wide.walls.sources(), {});
  const WideLuma::Seen other = WideLuma(wide.walls.rig, wide.walls.mesh, wide.view, rest).see(wide.walls.sources(), {});
  sum.moments.add(other.moments);
  sum.gains.add(other.gains);
  EXPECT_EQ(sum.moments.weight, whole.moments.weight);
  EXPECT_EQ(sum.moments.luma, whole.moments.luma);
  EXPECT_EQ(sum.moments.square, whole.moments.square);
  EXPECT_EQ(sum.gains, whole.gains);
}

TEST(WideLuma, AMeanThatTellsNothingIsLeftAlone) {
  const Wide wide;
  const WideLuma::Seen seen = wide.luma.see(wide.walls.sources(), {});
  EXPECT_FALSE(WideLuma::ratio(seen.cameras[0], {}).has_value()) << "of another size";
  EXPECT_FALSE(WideLuma::ratio(seen.cameras[0], std::vector<uint8_t>(300, 0)).has_value()) << "nowhere defined";
}

TEST(WideLuma, CamerasWithoutAnImageAreLeftOut) {
  const Wide wide;
  std::vector<Source> sources = wide.walls.sources();
  sources[4].image = {};
  EXPECT_EQ(wide.luma.see(sources, {}).cameras.size(), 8u);
  sources[4].image = wide.walls.images[4].view();
  sources[4].image.width = 80;
  EXPECT_THROW(wide.luma.see(sources, {}), Error);
}

}  // namespace
}  // namespace lf
