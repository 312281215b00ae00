// SPDX-License-Identifier: LGPL-2.1-or-later
#include "focus/autofocus.h"

#include "focus/depth_estimator.h"
#include "lib/focus/array_of_walls.h"
#include "support/photographs.h"
#include "support/test.h"

namespace lf {
namespace {

using test::ArrayOfWalls;

// Returns the distance that both stages find at a pixel, starting with a wrong focus.
double find(const ArrayOfWalls& walls, double begin, const Vec2& pixel) {
  DepthEstimator control;
  std::optional<double> found;
  for (int stage = 0; stage < 2; stage++) {
    ViewRequest request;
    request.view = view_around(walls.view(0), pixel);
    request.view.focus.plane = focal_plane_at(request.view.pose, begin);
    add_focus_sweep(request, {{0, 0, 1}, 0}, found, sweep_reach(walls.rig, request.view));
    EXPECT_NO_THROW(validate(request.view));
    EXPECT_LE(request.hypotheses.size(), kMaxHypotheses);
    const DepthEstimator::Plan plan =
        control.next(request, walls.moments(request.view, request.hypotheses, walls.own), Plane{{0, 0, 1}, 0});
    EXPECT_TRUE(plan.hypotheses.empty());
    found = focus_distance_at(plan.view, {kSweptPixels / 2, kSweptPixels / 2});
    if (!found) return -1;
  }
  return *found;
}

TEST(Autofocus, FindsTheWallAtAPixel) {
  const ArrayOfWalls walls;
  for (const double begin : {1.0, 2.0, 6.0, 30.0}) {
    EXPECT_NEAR(find(walls, begin, {40, 60}), 3, 0.2) << begin;
    EXPECT_NEAR(find(walls, begin, {120, 60}), 1.5, 0.1) << begin;
  }
}

// The built-in scene has bricks and tiles, which look alike at many distances.
TEST(Autofocus, IgnoresRepeatedPatterns) {
  const Rig rig = scene_rig(4, 4, 160, 120);
  const Mesh mesh = build_mesh(rig);
  const std::vector<Image> images = test::scene_images(rig, 0.5, 2);
  const CameraSet own = test::all_cameras(rig);
  std::vector<Source> sources;
  for (const CameraIndex i : own) sources.push_back({i, &rig.cameras[i], images[i].view()});
  const Plane from{{0, 0, 1}, 0};
  for (const double begin : {0.7, 1.3, 2.2, 4.0, 20.0})
    for (const auto& [pixel, distance] : {std::pair(Vec2(20, 20), kSceneFar), {Vec2(32, 85), kSceneNear}}) {
      DepthEstimator control;
      std::optional<double> found;
      for (int stage = 0; stage < 2; stage++) {
        ViewRequest request;
        request.view.width = 160;
        request.view.height = 120;
        request.view.lens = rig.cameras[0].lens;
        request.view.pose.position = {0.003, -0.002, 0};
        request.view.focus.plane = focal_plane_at(request.view.pose, begin);
        request.view = view_around(request.view, pixel);
        add_focus_sweep(request, from, found, sweep_reach(rig, request.view));
        const std::vector<std::vector<uint8_t>> levels = hypothesis_levels(request.view, request.hypotheses);
        std::vector<PhotoConsistency> sums(levels.size());
        for (PhotoConsistency& sum : sums) sum.reset(request.view.focus.map->columns, request.view.focus.map->rows);
        add_consistency(RenderJob(rig, mesh, hypothesis_view(request.view), own), sources, levels, sums);
        found = focus_distance_at(control.next(request, sums, from).view, {kSweptPixels / 2, kSweptPixels / 2});
        ASSERT_TRUE(found.has_value());
      }
      EXPECT_NEAR(*found / distance, 1, 0.15) << "from " << begin << " m";
    }
}

TEST(Autofocus, ReachIsLimitedByThePlaneSpacing) {
  const Rig rig = scene_rig(4, 4, 160, 120);
  View view{.width = 160, .height = 120, .lens = Lens::pinhole(100, 79.5, 59.5), .pose = {}, .focus = {}};
  // 15 planes 2 pixels apart starting at infinity; 0.04 m x 100 pixels move by 4 for each 1/m.
  EXPECT_NEAR(sweep_reach(rig, view), 7.5, 1e-9);
  view.lens = Lens::pinhole(400, 79.5, 59.5);
  EXPECT_NEAR(sweep_reach(rig, view), 7.5 / 4.0, 1e-9);
  EXPECT_EQ(sweep_reach(scene_rig(1, 1, 160, 120), view), 0);
}

TEST(Autofocus, SmallViewHasTheSameLinesOfSight) {
  View view{.width = 160,
            .height = 120,
            .lens = Lens(LensModel::kRadial, {200, 79.5, 59.5, -0.1, 0.01}),
            .pose = {},
            .focus = {}};
  const View around = view_around(view, {20, 100});
  EXPECT_EQ(around.width, kSweptPixels);
  const Vec2 a = *view.lens.unproject({20, 100}), b = *around.lens.unproject({31.5, 31.5});
  EXPECT_NEAR(glm::length(a - b), 0, 1e-12);
  EXPECT_NEAR(glm::length(*view.lens.unproject({25, 93}) - *around.lens.unproject({36.5, 24.5})), 0, 1e-12);
}

TEST(Autofocus, DetectsTheLimitsOfASweep) {
  EXPECT_TRUE(is_inside_sweep(2, 2));
  EXPECT_TRUE(is_inside_sweep(2.8, 2));
  EXPECT_FALSE(is_inside_sweep(2.98, 2));
  EXPECT_FALSE(is_inside_sweep(1.34, 2));
}

TEST(Autofocus, DistancesAreAlongTheAxis) {
  const ArrayOfWalls walls;
  View view = walls.view(170);
  EXPECT_NEAR(*focus_distance_at(view, {3, 3}), 1.5, 1e-9) << "in the corner, too";
  view.pose.position.z = 0.5;
  EXPECT_NEAR(*focus_distance_at(view, {80, 60}), 1, 1e-9);
  view.pose.position.z = 1.6;
  EXPECT_FALSE(focus_distance_at(view, {80, 60}).has_value()) << "behind the viewpoint";
  view.pose.position.z = 0;
  auto far_away = std::make_shared<FocalMap>(*view.focus.map);
  far_away->farthest = 0;
  far_away->levels.assign(far_away->levels.size(), 0);
  view.focus.map = far_away;
  EXPECT_FALSE(focus_distance_at(view, {80, 60}).has_value()) << "infinity";
}

}  // namespace
}  // namespace lf
