// SPDX-License-Identifier: LGPL-2.1-or-later
#include "focus/trial_renderer.h"

#include <gtest/gtest.h>

#include "lib/focus/array_of_walls.h"
#include "render/camera_projection.h"
#include "render/ownership.h"

namespace lf {
namespace {

using enum Trial::Kind;
using test::ArrayOfWalls;

TEST(TrialRenderer, CamerasAgreeWhereTheSurfaceIs) {
  const ArrayOfWalls walls;
  const View view = walls.view(60);
  const std::vector<Moments> moments = walls.moments(view, {{kPlane, 60}, {kPlane, 170}, {kPlane, 240}}, walls.own);
  const auto mean_deviation = [&](size_t trial, bool right) {
    double sum = 0;
    int count = 0;
    for (int j = 5; j < 25; j++)
      for (int i = right ? 25 : 5; i < (right ? 35 : 15); i++, count++) sum += moments[trial].deviation(j * 40 + i);
    return sum / count;
  };
  EXPECT_LT(mean_deviation(0, false), 1.5);
  EXPECT_LT(mean_deviation(1, true), 1.5);
  EXPECT_GT(mean_deviation(1, false), 4);
  EXPECT_GT(mean_deviation(0, true), 4);
  EXPECT_GT(mean_deviation(2, true), 2.5);
}

// Against the rule in double precision, camera by camera.
TEST(TrialRenderer, SumsAreThoseOfTheRule) {
  const ArrayOfWalls walls;
  const View view = walls.view(100), trial = trial_view(view);
  const std::vector<Moments> moments = walls.moments(view, {{kPlane, 130}}, walls.own);
  const ViewPlan plan(walls.rig, walls.mesh, trial);
  const OwnerMap owners(plan, {0, 0, trial.width, trial.height});
  double worst_mean = 0;
  for (int j = 0; j < trial.height; j++)
    for (int i = 0; i < trial.width; i++) {
      const Vec2 ray = plan.rays().at(i, j);
      double weight = 0, luma = 0;
      for (CameraIndex camera = 0; camera < walls.rig.cameras.size(); camera++) {
        const double w = CameraCorners(plan, camera).weight(plan, owners.at(i, j), ray);
        Vec2 pixel;
        if (w == 0 || !CameraProjection(plan, camera, walls.rig.cameras[camera])
                           .project(ray, trial.focus.map->inverse_of(130), pixel))
          continue;
        const Image& image = walls.images[camera];
        double mean = 0;  // over the box, bilinear between pixels
        for (int y = 0; y < 4; y++)
          for (int x = 0; x < 4; x++) {
            const double px = std::clamp(pixel.x + x - 1.5, 0., 159.), py = std::clamp(pixel.y + y - 1.5, 0., 119.);
            const int x0 = std::min(static_cast<int>(px), 158), y0 = std::min(static_cast<int>(py), 118);
            const auto at = [&](int k, int l) { return image.data()[3 * (l * 160 + k)]; };
            const double a = px - x0, b = py - y0;
            mean += ((1 - b) * ((1 - a) * at(x0, y0) + a * at(x0 + 1, y0)) +
                     b * ((1 - a) * at(x0, y0 + 1) + a * at(x0 + 1, y0 + 1))) /
                    16;
          }
        weight += w;
        luma += w * mean;
      }
      const size_t node = static_cast<size_t>(j) * trial.width + i;
      EXPECT_NEAR(moments[0].weight[node] / 32768., weight, 1e-4);
      if (weight < 0.99) continue;
      worst_mean = std::max(worst_mean, std::abs(moments[0].luma[node] / 128. - luma));
    }
  EXPECT_GT(worst_mean, 0);
  EXPECT_LT(worst_mean, 1.5) << "two roundings to 8 bits, and to 256ths of a pixel";
}

TEST(TrialRenderer, PartsOfAnArrayAddUpToTheWhole) {
  const ArrayOfWalls walls;
  const View view = walls.view(60);
  const std::vector<Trial> trials{{kBlurred, 0}, {kShifted, 40}};
  const std::vector<Moments> whole = walls.moments(view, trials, walls.own);
  std::vector<Moments> sum = walls.moments(view, trials, {0, 1, 2, 3});
  const std::vector<Moments> rest = walls.moments(view, trials, {4, 5, 6, 7, 8});
  for (size_t t = 0; t < trials.size(); t++) {
    sum[t].add(rest[t]);
    EXPECT_EQ(sum[t].weight, whole[t].weight);
    EXPECT_EQ(sum[t].luma, whole[t].luma);
    EXPECT_EQ(sum[t].square, whole[t].square);
  }
}

}  // namespace
}  // namespace lf
