// SPDX-License-Identifier: LGPL-2.1-or-later
#include "render/contribution_map.h"

#include <gtest/gtest.h>

#include "support/expect_error.h"

namespace lf {
namespace {

Rig grid(int rows, int columns) {
  Rig rig;
  for (int i = 0; i < rows * columns; i++) {
    Camera camera;
    camera.id = static_cast<uint32_t>(i);
    camera.width = camera.height = 64;
    camera.lens = Lens::pinhole(60, 31.5, 31.5);
    camera.pose.position = {0.1 * (i % columns), 0.1 * (i / columns), 0};
    rig.cameras.push_back(camera);
  }
  rig.topology = {Topology::Type::kGrid, rows, columns, {}};
  return rig;
}

// From behind the array: all faces are in sight, seen by 64x64 pixels.
View from_behind(const Rig& rig, double distance) {
  View view{64, 64, Lens::pinhole(64, 31.5, 31.5), {}, {plane_through({0, 0, 3}, {0, 0, 1})}};
  const Vec3 far_corner = rig.cameras.back().pose.position;
  view.pose.position = {far_corner.x / 2, far_corner.y / 2, -distance};
  return view;
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

TEST(ValidWeights, AreTheHatLessWhatIsLost) {
  const Rig rig = grid(2, 2);
  const View view = from_behind(rig, 0.5);
  const ViewPlan plan(rig, build_mesh(rig), view);
  const OwnerMap owners(plan, {0, 0, 64, 64});
  const Rect rect = plan.camera_rect(0);
  ASSERT_FALSE(rect.empty());
  // All in sight of a camera that sees everything; nothing of one that looks the other way.
  EXPECT_EQ(valid_weights(plan, owners, 0, rig.cameras[0], rect), pixel_weights(plan, owners, 0, rect));
  Camera away = rig.cameras[0];
  away.pose.orientation = Quat(0, 0, 1, 0);
  for (const float w : valid_weights(plan, owners, 0, away, rect)) ASSERT_EQ(w, 0);
}

TEST(MeanCoverage, IsTheMeanOfTheCoverage) {
  const Rig rig = grid(3, 3);
  const View view = from_behind(rig, 0.4);
  const ViewPlan plan(rig, build_mesh(rig), view);
  double sum = 0;
  for (const float c : view_coverage(rig, plan, OwnerMap(plan, {0, 0, 64, 64}))) sum += c;
  EXPECT_NEAR(mean_coverage(rig, plan, 64), sum / (64 * 64), 1e-9);
  EXPECT_NEAR(mean_coverage(rig, plan, 16), sum / (64 * 64), 0.05);
  EXPECT_GT(sum, 0);
}

TEST(PixelShares, NameWhoMakesThePixel) {
  Rig rig = grid(3, 3);
  rig.cameras[1].pose.orientation = Quat(0.995, 0, 0.0998, 0);  // looks aside
  rig.cameras[1].lens = Lens::pinhole(600, 31.5, 31.5);
  const View view = from_behind(rig, 0.4);
  const ViewPlan plan(rig, build_mesh(rig), view);
  EXPECT_TRUE(pixel_shares(rig, plan, 0, 0).empty()) << "beside the array";
  // 0.03 m left of the middle camera and 0.02 m above it: on the triangle (1, 4, 3).
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

TEST(ContributionMap, EveryCameraShowsItsColourWhereItIsSeen) {
  const Rig rig = grid(3, 3);
  const Mesh mesh = build_mesh(rig);
  const View view = from_behind(rig, 0.3);
  const Image map = contribution_map(rig, mesh, view);
  const std::vector<CameraColour> colours = camera_colours(mesh, 9);
  // The line of sight through camera 4 is the middle of the view; beside the faces' outlines it is that camera's alone.
  const uint8_t* p = map.pixel(32 + 3, 32 + 1);
  EXPECT_NEAR(p[0], colours[4].r, 45);
  EXPECT_NEAR(p[1], colours[4].g, 45);
  EXPECT_NEAR(p[2], colours[4].b, 45);
  // Outside the array there is nobody.
  EXPECT_EQ(map.pixel(1, 1)[0] + map.pixel(1, 1)[1] + map.pixel(1, 1)[2], 0);
}

TEST(ContributionMap, OutlinesTheFaces) {
  const Rig rig = grid(2, 2);
  const View view = from_behind(rig, 0.15);
  const Image map = contribution_map(rig, build_mesh(rig), view);
  // The diagonal of the cell runs from camera 1 (above right) to camera 2 (below left), through the middle.
  const auto light = [&](int x, int y) {
    const uint8_t* p = map.pixel(x, y);
    return p[0] + p[1] + p[2];
  };
  for (int k = -15; k <= 15; k++) {
    EXPECT_LT(light(31 + k, 32 - k), 100) << k;
    EXPECT_GT(light(31 + k - 5, 32 - k - 5), 150) << k;
  }
}

TEST(ContributionMap, APictureShowsThrough) {
  const Rig rig = grid(2, 2);
  const Mesh mesh = build_mesh(rig);
  const View view = from_behind(rig, 0.15);
  Image white(PixelFamily::kRgb, 64, 64), black(PixelFamily::kRgb, 64, 64);
  std::fill(white.data().begin(), white.data().end(), uint8_t{255});
  EXPECT_EQ(contribution_map(rig, mesh, view, &white).data(), contribution_map(rig, mesh, view).data());
  EXPECT_LT(contribution_map(rig, mesh, view, &black).pixel(20, 20)[1],
            contribution_map(rig, mesh, view, &white).pixel(20, 20)[1]);
  const Image other(PixelFamily::kRgb, 63, 64);
  EXPECT_ERROR(contribution_map(rig, mesh, view, &other), "of the view's size");
}

TEST(ContributionMap, WorksWithoutTriangles) {
  for (const int columns : {1, 2, 4}) {
    const Rig rig = grid(1, columns);
    View view = from_behind(rig, 0.3);
    const Image map = contribution_map(rig, build_mesh(rig), view);
    EXPECT_GT(map.pixel(30, 30)[0] + map.pixel(30, 30)[1] + map.pixel(30, 30)[2], 60) << columns;
  }
}

}  // namespace
}  // namespace lf
