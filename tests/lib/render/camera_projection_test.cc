// SPDX-License-Identifier: LGPL-2.1-or-later
#include "render/camera_projection.h"

#include "geometry/pose.h"
#include "reference/generators.h"
#include "scene/scene.h"
#include "support/rigs.h"
#include "support/test.h"

namespace lf {
namespace {

View view_at(const Vec3& eye, double focus) {
  const Pose pose = look_at(eye, Vec3(0.1, 0, 3), Vec3(0, 1, 0));
  return {40, 30, Lens::from_fov_y(40, 40, 30), pose, {focal_plane_at(pose, focus)}};
}

TEST(CameraProjection, ProjectsTheFocalPoint) {
  Rig rig = scene_rig(2, 2, 64, 48);
  rig.cameras[2].lens = Lens(LensModel::kRadial, {80, 31.5, 23.5, -0.1, 0.02});
  const Mesh mesh = build_mesh(rig);
  for (const double focus : {0.5, 2.0, 100.0}) {
    const View view = view_at({0.03, -0.02, -0.1}, focus);
    const ViewPlan plan(rig, mesh, view);
    for (CameraIndex i = 0; i < rig.cameras.size(); i++) {
      const Camera& camera = rig.cameras[i];
      const CameraProjection projection(plan, i, camera);
      for (int y = 0; y < view.height; y += 7)
        for (int x = 0; x < view.width; x += 7) {
          const Vec3 d(*view.lens.unproject(Vec2(x, y)), 1);
          const Vec3 point = view.pose.world_from_camera(d * focus);  // the plane faces the view
          const std::optional<Vec2> expected = camera.lens.project(camera.pose.camera_from_world(point));
          Vec2 pixel;
          const bool inside = expected && expected->x >= -0.5 && expected->x <= camera.width - 0.5 &&
                              expected->y >= -0.5 && expected->y <= camera.height - 0.5;
          ASSERT_EQ(projection.project(Vec2(d), 0, pixel), inside);
          if (!inside) continue;
          EXPECT_NEAR(pixel.x, expected->x, 1e-9);
          EXPECT_NEAR(pixel.y, expected->y, 1e-9);
        }
    }
  }
}

TEST(CameraProjection, PointsBehindTheCameraAreInvisible) {
  Rig rig = scene_rig(2, 2, 64, 48);
  const View view = view_at({0, 0, -5}, 2);  // the focal plane is 3 m behind the cameras
  const ViewPlan plan(rig, build_mesh(rig), view);
  Vec2 pixel;
  EXPECT_FALSE(CameraProjection(plan, 0, rig.cameras[0]).project(Vec2(0, 0), 0, pixel));
}

TEST(CameraProjection, TheImageEndsHalfAPixelBeyondItsOuterCentres) {
  Rig rig = scene_rig(2, 2, 64, 48);
  const Camera& camera = rig.cameras[0];
  const View view{64, 48, camera.lens, camera.pose, {focal_plane_at(camera.pose, 2)}};
  const ViewPlan plan(rig, build_mesh(rig), view);
  const CameraProjection projection(plan, 0, rig.cameras[0]);
  const Lens& lens = view.lens;
  const auto sees = [&](double x, double y) {
    Vec2 pixel;
    return projection.project(Vec2((x - lens.cx()) / lens.fx(), (y - lens.cy()) / lens.fy()), 0, pixel);
  };
  EXPECT_TRUE(sees(-0.499, 0));
  EXPECT_FALSE(sees(-0.501, 0));
  EXPECT_TRUE(sees(63.499, 47.499));
  EXPECT_FALSE(sees(63.501, 0));
  EXPECT_FALSE(sees(0, 47.501));
}

int area(const Rect& rect) { return rect.empty() ? 0 : rect.width() * rect.height(); }

// Returns all pixels that sampling the camera for the rectangle reads, including chroma.
Rect sampled_pixels(const ViewPlan& plan, const Rect& rect, CameraIndex index, const Camera& camera) {
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

// Near the view's plane: a band of levels within a wide range.
std::shared_ptr<const FocalMap> random_map(reference::Random& random, const View& view) {
  FocalMap map = FocalMap::for_view(view.width, view.height);
  // Measured in the viewing direction, from a point before the plane.
  const Plane& plane = view.focus.plane;
  const double side = glm::dot(plane.normal, view.pose.forward()) < 0 ? -1 : 1;
  map.from = {side * plane.normal, side * plane.d + random.uniform(0.5, 3)};
  map.nearest = random.uniform(0.5, 2);
  const double least = random.uniform(0, 250), largest = random.uniform(least, 256);
  for (int i = 0; i < map.columns * map.rows; i++)
    map.levels.push_back(static_cast<uint8_t>(random.uniform(least, largest)));
  return std::make_shared<const FocalMap>(std::move(map));
}

TEST(SourceRegion, ContainsEverySample) {
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
      const Rect need = sampled_pixels(plan, rect, camera, rig.cameras[camera]);
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

TEST(SourceRegion, IsTight) {
  const Rig rig = scene_rig(8, 8, 640, 480);
  const View view = test::view_from({0.01, 0.02, -0.6}, 640, 480, 33, kSceneMiddle);
  const ViewPlan plan(rig, build_mesh(rig), view);
  int needed = 0, decoded = 0;
  for (const CameraIndex camera : plan.contributors()) {
    needed += area(sampled_pixels(plan, plan.camera_rect(camera), camera, rig.cameras[camera]));
    decoded += area(source_region(plan, plan.camera_rect(camera), camera, rig.cameras[camera]));
  }
  EXPECT_GT(needed, 0);
  EXPECT_LT(decoded, needed * 1.4);
}

class PixelForPixelTest : public testing::Test {
 protected:
  PixelForPixelTest() {
    camera_.width = 320;
    camera_.height = 240;
    camera_.lens = Lens(LensModel::kRadial, {400, 159.5, 119.5, -0.1, 0.02});
    camera_.pose.position = {3, -2, 1};
    camera_.pose.orientation = quat_from_euler({20, -5, 3});
    view_ = {camera_.width, camera_.height, camera_.lens, camera_.pose, {}};
    view_.focus.plane = focal_plane_at(view_.pose, 2);
  }
  Camera camera_;
  View view_;
};

TEST_F(PixelForPixelTest, ViewOfTheCameraIsPixelForPixel) {
  EXPECT_TRUE(is_pixel_for_pixel(view_, camera_));
  EXPECT_FALSE(shows_detail(view_, camera_));
}

TEST_F(PixelForPixelTest, CropOfTheViewIsPixelForPixel) {
  view_.width = 100;
  view_.height = 80;
  view_.lens = Lens(LensModel::kRadial, {400, 149.5, 89.5, -0.1, 0.02});
  EXPECT_TRUE(is_pixel_for_pixel(view_, camera_));
  view_.lens = Lens(LensModel::kRadial, {400, 149.2, 89.5, -0.1, 0.02});
  EXPECT_FALSE(is_pixel_for_pixel(view_, camera_)) << "between its pixels";
}

TEST_F(PixelForPixelTest, OtherViewsAreNotPixelForPixel) {
  const auto expect_detail = [this](const char* what, const auto& change) {
    View other = view_;
    change(other);
    EXPECT_TRUE(shows_detail(other, camera_)) << what;
  };
  expect_detail("beside", [](View& view) { view.pose.position.x += 0.001; });
  expect_detail("turned", [](View& view) { view.pose.orientation = quat_from_euler({20.02, -5, 3}); });
  expect_detail("other distortion", [](View& view) { view.lens = Lens::pinhole(400, 159.5, 119.5); });
  expect_detail("zoomed", [](View& view) { view.lens = Lens(LensModel::kRadial, {402, 159.5, 119.5, -0.1, 0.02}); });
  expect_detail("twice as large", [](View& view) {
    view.lens = Lens(LensModel::kRadial, {800, 319, 239, -0.1, 0.02});
    view.width = 639;
    view.height = 479;
  });
}

TEST_F(PixelForPixelTest, CoarseViewsShowNoDetail) {
  view_.pose.position.x += 0.1;
  view_.lens = Lens::pinhole(301, 159.5, 119.5);
  EXPECT_TRUE(shows_detail(view_, camera_));
  view_.lens = Lens::pinhole(299, 159.5, 119.5);
  EXPECT_FALSE(shows_detail(view_, camera_));
}

}  // namespace
}  // namespace lf
