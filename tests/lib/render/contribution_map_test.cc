// SPDX-License-Identifier: LGPL-2.1-or-later
#include "render/contribution_map.h"

#include "geometry/pose.h"
#include "rig/rig.h"
#include "support/expect_error.h"
#include "support/rigs.h"
#include "support/test.h"

namespace lf {
namespace {

Rig grid(int rows, int columns) { return test::camera_grid(rows, columns, 0.1, 64, 64, 60); }

// A 64x64 view of all faces, from the back of the array.
View from_behind(const Rig& rig, double distance) {
  View view{64, 64, Lens::pinhole(64, 31.5, 31.5), {}, {plane_through({0, 0, 3}, {0, 0, 1})}};
  const Vec3 far_corner = rig.cameras.back().pose.position;
  view.pose.position = {far_corner.x / 2, far_corner.y / 2, -distance};
  view.blending.extrapolates = false;
  return view;
}

struct Scene {
  Scene(const Rig& rig, const View& view) : plan(rig, build_mesh(rig), view), owners(plan, {0, 0, 64, 64}) {}
  ViewPlan plan;
  FaceIdMap owners;
};

double sum_of(const std::vector<float>& values) { return std::accumulate(values.begin(), values.end(), 0.0); }

int light(const Image& image, int x, int y) {
  const uint8_t* const pixel = image.pixel(x, y);
  return pixel[0] + pixel[1] + pixel[2];
}

TEST(CameraColours, NeighboursDiffer) {
  const Rig rig = grid(8, 8);
  const Mesh mesh = build_mesh(rig);
  const std::vector<CameraColour> colours = camera_colours(mesh, 64);
  ASSERT_EQ(colours.size(), 64u);
  for (const MeshFace& face : mesh.faces) {
    EXPECT_NE(colours[face.camera[0]], colours[face.camera[1]]);
    EXPECT_NE(colours[face.camera[1]], colours[face.camera[2]]);
    EXPECT_NE(colours[face.camera[2]], colours[face.camera[0]]);
  }
}

TEST(ValidWeights, AreTheWeightsWithoutMissingOnes) {
  const Rig rig = grid(2, 2);
  const auto [plan, owners] = Scene(rig, from_behind(rig, 0.5));
  const Rect rect = plan.camera_rect(0);
  ASSERT_FALSE(rect.empty());
  // The full weight of a camera that sees everything; no weight of a camera that looks away.
  EXPECT_EQ(valid_weights(plan, owners, 0, rig.cameras[0], rect), pixel_weights(plan, owners, 0, rect));
  Camera away = rig.cameras[0];
  away.pose.orientation = Quat(0, 0, 1, 0);
  for (const float w : valid_weights(plan, owners, 0, away, rect)) ASSERT_EQ(w, 0);
}

TEST(MeanCoverage, IsTheMeanOfTheCoverage) {
  const Rig rig = grid(3, 3);
  const auto [plan, owners] = Scene(rig, from_behind(rig, 0.4));
  const double sum = sum_of(view_coverage(rig, plan, owners));
  EXPECT_NEAR(mean_coverage(rig, plan, 64, 64).seen, sum / (64 * 64), 1e-9);
  EXPECT_NEAR(mean_coverage(rig, plan, 24, 12).seen, sum / (64 * 64), 0.02);
  EXPECT_GT(sum, 0);
}

TEST(PixelShares, ListTheCamerasOfAPixel) {
  Rig rig = grid(3, 3);
  rig.cameras[1].pose.orientation = Quat(0.995, 0, 0.0998, 0);
  rig.cameras[1].lens = Lens::pinhole(600, 31.5, 31.5);
  const ViewPlan plan(rig, build_mesh(rig), from_behind(rig, 0.4));
  EXPECT_TRUE(pixel_shares(rig, plan, 0, 0).empty()) << "beside the array";
  // 0.03 m left of the centre camera and 0.02 m above: on the triangle (1, 4, 3).
  const int x = static_cast<int>(31.5 - 0.03 / 0.4 * 64), y = static_cast<int>(31.5 - 0.02 / 0.4 * 64);
  const std::vector<PixelShare> shares = pixel_shares(rig, plan, x, y);
  ASSERT_EQ(shares.size(), 3u);
  EXPECT_EQ(shares[0].camera, 4u);
  EXPECT_EQ(shares[1].camera, 3u);
  EXPECT_EQ(shares[2].camera, 1u);
  EXPECT_NEAR(shares[0].weight + shares[1].weight + shares[2].weight, 1, 1e-6);
  EXPECT_TRUE(shares[0].sees);
  EXPECT_FALSE(shares[2].sees);
  EXPECT_NEAR(shares[2].weight, 0.2, 0.08);
}

TEST(ContributionMap, EveryCameraHasItsColour) {
  const Rig rig = grid(3, 3);
  const Mesh mesh = build_mesh(rig);
  const View view = from_behind(rig, 0.3);
  const Image map = contribution_map(rig, mesh, view);
  const std::vector<CameraColour> colours = camera_colours(mesh, 9);
  // The line of sight through camera 4 is at the view's centre; next to the outlines of the faces, only that camera
  // contributes.
  const uint8_t* p = map.pixel(32 + 3, 32 + 1);
  EXPECT_NEAR(p[0], colours[4].r, 45);
  EXPECT_NEAR(p[1], colours[4].g, 45);
  EXPECT_NEAR(p[2], colours[4].b, 45);
  EXPECT_EQ(light(map, 1, 1), 0);
}

TEST(ContributionMap, OutlinesTheFaces) {
  const Rig rig = grid(2, 2);
  const View view = from_behind(rig, 0.15);
  const Image map = contribution_map(rig, build_mesh(rig), view);
  // The cell's diagonal runs from camera 1 (upper right) to camera 2 (lower left), through the centre.
  for (int k = -15; k <= 15; k++) {
    EXPECT_LT(light(map, 31 + k, 32 - k), 100) << k;
    EXPECT_GT(light(map, 31 + k - 5, 32 - k - 5), 150) << k;
  }
}

TEST(ContributionMap, UnderlayShowsThrough) {
  const Rig rig = grid(2, 2);
  const Mesh mesh = build_mesh(rig);
  const View view = from_behind(rig, 0.15);
  Image white(PixelFamily::kRgb, 64, 64), black(PixelFamily::kRgb, 64, 64);
  std::fill(white.data().begin(), white.data().end(), uint8_t{255});
  EXPECT_EQ(contribution_map(rig, mesh, view, &white).data(), contribution_map(rig, mesh, view).data());
  EXPECT_LT(contribution_map(rig, mesh, view, &black).pixel(20, 20)[1],
            contribution_map(rig, mesh, view, &white).pixel(20, 20)[1]);
  const Image other(PixelFamily::kRgb, 63, 64);
  EXPECT_ERROR(contribution_map(rig, mesh, view, &other), "size");
}

TEST(ContributionMap, WorksWithoutTriangles) {
  for (const int columns : {1, 2, 4}) {
    const Rig rig = grid(1, columns);
    EXPECT_GT(light(contribution_map(rig, build_mesh(rig), from_behind(rig, 0.3)), 30, 30), 60) << columns;
  }
}

constexpr double kAspect = 4.0 / 3;

Rig array(int rows, int columns) {
  return make_grid_rig({.rows = rows, .columns = columns, .pitch = 0.1, .fov_y_deg = 40, .width = 320, .height = 240});
}
Viewpoint moved(const Rig& rig, const Vec3& by) {
  Viewpoint v = default_viewpoint(rig);
  v.pose.position += by;
  return v;
}

TEST(VisibleFraction, IsOneInsideAndZeroBesideTheArray) {
  const Rig rig = array(4, 6);
  const VisibleFraction share(rig);
  EXPECT_NEAR(share(moved(rig, {0.02, 0.03, 0}), kAspect), 1, 1e-6);
  EXPECT_NEAR(share(moved(rig, {0.24, 0.14, 0}), kAspect), 1, 1e-6);
  EXPECT_EQ(share(moved(rig, {0.26, 0, 0}), kAspect), 0);
  EXPECT_EQ(share(moved(rig, {0, -0.16, 0}), kAspect), 0);
}

TEST(VisibleFraction, ViewFromBehindIsAWindow) {
  const Rig rig = array(4, 6);
  const VisibleFraction share(rig);
  // 1 m behind the array: 0.5 m of the view's width of 2 tan(20) m x 4/3, times 0.3 m of its height of 2 tan(20) m.
  const double height = 2 * std::tan(20 * M_PI / 180);
  EXPECT_NEAR(share(moved(rig, {0, 0, -1}), kAspect), 0.5 / (height * kAspect) * 0.3 / height, 0.05);
  EXPECT_LT(share(moved(rig, {0, 0, -3}), kAspect), share(moved(rig, {0, 0, -1}), kAspect));
}

TEST(VisibleFraction, ExcludesInvisibleParts) {
  const Rig rig = array(4, 6);
  const VisibleFraction share(rig);
  Viewpoint wide = default_viewpoint(rig);
  wide.fov_y_deg = 2 * std::atan(2 * std::tan(20 * M_PI / 180)) * 180 / M_PI;
  EXPECT_NEAR(share(wide, kAspect), 0.25, 0.06);
  EXPECT_NEAR(share(default_viewpoint(rig), 2 * kAspect), 0.5, 0.06);
}

TEST(VisibleFraction, DoesNotDependOnTheFocus) {
  const Rig rig = array(4, 6);
  const VisibleFraction share(rig);
  Viewpoint near = moved(rig, {0.1, 0.05, 0.1});
  near.focus_distance = 0.01;
  EXPECT_EQ(share(near, kAspect), share(moved(rig, {0.1, 0.05, 0.1}), kAspect));
}

TEST(VisibleFraction, OneCameraAndARow) {
  const Rig one = array(1, 1);
  Viewpoint turned = default_viewpoint(one);
  EXPECT_NEAR(VisibleFraction(one)(turned, kAspect), 1, 1e-6);
  turned.pose.orientation = glm::angleAxis(M_PI / 2, Vec3(0, 1, 0));
  EXPECT_EQ(VisibleFraction(one)(turned, kAspect), 0);
  const Rig row = array(1, 5);
  EXPECT_NEAR(VisibleFraction(row)(moved(row, {0.1, 0.05, 0}), kAspect), 1, 1e-6);
  EXPECT_EQ(VisibleFraction(row)(moved(row, {0.3, 0, 0}), kAspect), 0);
}

ptrdiff_t dark_pixels(const Rig& rig, const Mesh& mesh, const View& view) {
  const ViewPlan plan(rig, mesh, view);
  const std::vector<float> seen = view_coverage(rig, plan, FaceIdMap(plan, {0, 0, view.width, view.height}));
  return std::ranges::count_if(seen, [](float s) { return s <= 0; });
}

TEST(VisibleFraction, HomeFitsTheAspectRatio) {
  for (const double error : {0.0, 2.0}) {
    Rig rig = array(4, 6);
    std::mt19937 random(3);
    std::uniform_real_distribution<double> degrees(-error, error);
    for (Camera& camera : rig.cameras)
      camera.pose.orientation = quat_from_euler({degrees(random), degrees(random), degrees(random)});
    const Mesh mesh = build_mesh(rig);
    const VisibleFraction share(rig);
    for (const double aspect : {0.15, 0.5, 0.75, 1.0, kAspect, 16.0 / 9, 21.0 / 9, 4.8, 8.0}) {
      const Viewpoint home = share.home(aspect);
      const double high = std::tan(home.fov_y_deg * M_PI / 360), camera = std::tan(20 * M_PI / 180);
      if (error == 0) {
        EXPECT_NEAR(std::max(high, high * aspect / kAspect), camera, 0.06 * camera) << aspect;
      }
      EXPECT_GT(std::max(high, high * aspect / kAspect), 0.85 * camera) << aspect;
      const int height = 240, width = static_cast<int>(std::lround(height * aspect));
      // These pixels are smaller than the pixels that determined the home view.
      EXPECT_EQ(dark_pixels(rig, mesh, make_view(home, width, height)), 0) << aspect;
      EXPECT_LT(glm::length(home.pose.position - default_viewpoint(rig).pose.position), 0.06) << "pitch 0.1 m";
    }
  }
}

TEST(VisibleFraction, HomeOfASetHasNoDarkView) {
  const Rig rig = array(4, 6);
  const Mesh mesh = build_mesh(rig);
  const VisibleFraction share(rig);
  for (const ViewSetLayout layout : {ViewSetLayout::kStereo, ViewSetLayout::kRow, ViewSetLayout::kQuilt})
    for (const bool converged : {false, true})
      for (const double aspect : {0.75, kAspect}) {
        ViewSet set;
        set.layout = layout;
        set.columns = 5;
        set.rows = 2;
        set.eye_distance = layout == ViewSetLayout::kStereo ? 0.2 : 0.04;
        set.converged = converged;
        const Viewpoint home = share.home(aspect, 0, set);
        EXPECT_LE(home.fov_y_deg, share.home(aspect).fov_y_deg);
        EXPECT_NEAR(home.pose.position.x, default_viewpoint(rig).pose.position.x, 1e-9);
        const int height = 120, width = static_cast<int>(std::lround(height * aspect));
        for (int eye = 0; eye < set.place(0).count(); eye++) {
          const View view = set.view(make_view(home, width, height), set.place(eye));
          EXPECT_EQ(dark_pixels(rig, mesh, view), 0) << eye << " " << aspect;
        }
      }
}

// If the home view shows uncovered areas, a narrower view does not help.
TEST(VisibleFraction, HomeOfARingIsTheDefault) {
  Rig ring = array(1, 4);
  for (size_t i = 0; i < 4; i++) {
    ring.cameras[i].pose.orientation = glm::angleAxis(i * M_PI / 2, Vec3(0, 1, 0));
    ring.cameras[i].pose.position = ring.cameras[i].pose.forward();
  }
  EXPECT_EQ(VisibleFraction(ring).home(kAspect, 3).fov_y_deg, default_viewpoint(ring, 3).fov_y_deg);
  EXPECT_EQ(VisibleFraction(ring).home(kAspect, 3).focus_distance, 3);
}

TEST(MissingWeights, ComplementTheCoverage) {
  Rig rig = grid(3, 3);
  rig.cameras[4].pose.orientation = Quat(0, 0, 1, 0);  // looks back: its weight is lost
  const auto [plan, owners] = Scene(rig, from_behind(rig, 0.3));
  const std::vector<float> lost = missing_weights(rig, plan, owners), seen = view_coverage(rig, plan, owners);
  int outside = 0, some = 0;
  for (int y = 0; y < 64; y++)
    for (int x = 0; x < 64; x++) {
      const size_t i = static_cast<size_t>(y) * 64 + x;
      if (owners.at(x, y) == FaceIdMap::kNone) {
        EXPECT_TRUE(std::isnan(lost[i]));
        outside++;
      } else {
        EXPECT_NEAR(lost[i] + seen[i], 1, 1e-6);
        some += lost[i] > 0.5f;
      }
    }
  EXPECT_GT(outside, 100);
  EXPECT_GT(some, 100);
}

TEST(CameraContributions, MatchThePositionsSeenFromBehind) {
  const Rig rig = grid(3, 3);
  const View view = from_behind(rig, 0.5);
  const auto [plan, owners] = Scene(rig, view);
  const std::vector<CameraFootprint> places = camera_footprints(rig, plan, owners);
  ASSERT_EQ(places.size(), 9u);
  double sum = 0;
  for (const CameraFootprint& place : places) sum += place.weight;
  EXPECT_NEAR(sum, sum_of(view_coverage(rig, plan, owners)), 1e-2);
  // The centre camera's hat is symmetric.
  const Vec2 middle = *view.lens.project(view.pose.camera_from_world(rig.cameras[4].pose.position));
  EXPECT_NEAR(glm::length(places[4].middle - middle), 0, 0.2);
  EXPECT_LT(places[3].middle.x, places[4].middle.x);
  EXPECT_LT(places[1].middle.y, places[4].middle.y);
}

}  // namespace
}  // namespace lf
