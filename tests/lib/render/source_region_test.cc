// SPDX-License-Identifier: LGPL-2.1-or-later
#include "render/source_region.h"

#include <gtest/gtest.h>

#include "reference/generators.h"
#include "render/camera_projection.h"
#include "scene/scene.h"

namespace lf::test {
namespace {

int area(const Rect& rect) { return rect.empty() ? 0 : rect.width() * rect.height(); }

// All that sampling the camera for the rectangle touches, its chroma included.
Rect touched(const ViewPlan& plan, const Rect& rect, CameraIndex index, const Camera& camera) {
  const CameraProjection projection(plan, index, camera);
  Rect all;
  const auto sample = [&](const Vec2& ray, double inverse) {
    Vec2 p;
    if (std::isnan(ray.x) || !projection.project(ray, inverse, p)) return;
    const int x = static_cast<int>(std::floor(p.x)), y = static_cast<int>(std::floor(p.y));
    // The four chroma samples around p cover these luma pixels.
    const int cx = 2 * static_cast<int>(std::floor((p.x - 0.5) / 2)),
              cy = 2 * static_cast<int>(std::floor((p.y - 0.5) / 2));
    all = unite(all, {x, y, x + 2, y + 2});
    all = unite(all, {cx, cy, cx + 4, cy + 4});
  };
  for (int y = rect.y0; y < rect.y1; y++)
    for (int x = rect.x0; x < rect.x1; x++) {
      sample(plan.rays().at(x, y), plan.inverse_at(x, y));
      if (x % 2 == 0 && y % 2 == 0) sample(plan.rays().at_centre_of_four(x, y), plan.inverse_at(x + 0.5, y + 0.5));
    }
  return intersect(all, {0, 0, camera.width, camera.height});
}

// Somewhere around the view's plane, a band of levels of a wide range.
std::shared_ptr<const FocalMap> random_map(reference::Random& random, const View& view) {
  FocalMap map = FocalMap::for_view(view.width, view.height);
  // Counted towards where the view looks, from somewhere before the plane.
  const Plane& plane = view.focus.plane;
  const double side = glm::dot(plane.normal, view.pose.forward()) < 0 ? -1 : 1;
  map.from = {side * plane.normal, side * plane.d + random.uniform(0.5, 3)};
  map.nearest = random.uniform(0.5, 2);
  const double least = random.uniform(0, 250), largest = random.uniform(least, 256);
  for (int i = 0; i < map.columns * map.rows; i++)
    map.levels.push_back(static_cast<uint8_t>(random.uniform(least, largest)));
  return std::make_shared<const FocalMap>(std::move(map));
}

TEST(SourceRegion, HoldsEverySampleOfAnyRigAndSurface) {
  reference::Random random(7);
  int regions = 0, through_maps = 0;
  for (int i = 0; i < 300; i++) {
    Rig rig = reference::random_rig(random);
    for (Camera& camera : rig.cameras) camera.lens = reference::random_lens(random, camera.width, camera.height);
    View view = reference::random_view(random, rig, 160, 120);
    if (i % 2 == 1) view.focus.map = random_map(random, view);
    const ViewPlan plan(rig, build_mesh(rig), view);
    for (const CameraIndex camera : plan.contributors()) {
      const Rect rect = chroma_aligned(plan.camera_rect(camera), view);
      const Rect need = touched(plan, rect, camera, rig.cameras[camera]);
      if (need.empty()) continue;
      const Rect region = source_region(plan, rect, camera, rig.cameras[camera]);
      EXPECT_EQ(intersect(need, region), need)
          << "rig " << i << ", camera " << camera << ": " << need.x0 << "," << need.y0 << " to " << need.x1 << ","
          << need.y1 << " against " << region.x0 << "," << region.y0 << " to " << region.x1 << "," << region.y1;
      EXPECT_EQ(intersect(region, {0, 0, rig.cameras[camera].width, rig.cameras[camera].height}), region);
      regions++;
      through_maps += i % 2;
    }
  }
  EXPECT_GT(regions, 600);
  EXPECT_GT(through_maps, 300);
}

TEST(SourceRegion, IsLittleMoreThanThat) {
  const Rig rig = scene_rig(8, 8, 640, 480);
  View view;
  view.width = 640;
  view.height = 480;
  view.lens = Lens::from_fov_y(33, 640, 480);
  view.pose.position = Vec3(0.01, 0.02, -0.6);
  view.focus.plane = focal_plane_at(view.pose, kSceneMiddle);
  const ViewPlan plan(rig, build_mesh(rig), view);
  int needed = 0, decoded = 0;
  for (const CameraIndex camera : plan.contributors()) {
    needed += area(touched(plan, plan.camera_rect(camera), camera, rig.cameras[camera]));
    decoded += area(source_region(plan, plan.camera_rect(camera), camera, rig.cameras[camera]));
  }
  EXPECT_GT(needed, 0);
  EXPECT_LT(decoded, needed * 1.4);
}

}  // namespace
}  // namespace lf::test
