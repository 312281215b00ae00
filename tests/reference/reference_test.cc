// SPDX-License-Identifier: LGPL-2.1-or-later
// The yardstick itself, held against cases whose answer is known by hand.
#include <gtest/gtest.h>

#include "reference/generators.h"
#include "reference/renderer.h"

namespace lf::reference {
namespace {

Rig unit_triangle() {
  Rig rig;
  for (const Vec3& position : {Vec3(0, 0, 0), Vec3(1, 0, 0), Vec3(0, 1, 0)})
    rig.cameras.push_back(make_camera(static_cast<uint32_t>(rig.cameras.size()), 32, 32, Lens::pinhole(16, 15.5, 15.5),
                                      {position, {1, 0, 0, 0}}));
  rig.topology = {Topology::Type::kTriangles, 0, 0, {{0, 1, 2}}};
  return rig;
}
const Mesh kOneFace{{{{0, 1, 2}, {}}}};

TEST(Sight, WeightsAreBarycentricCoordinatesOfTheMeetingPoint) {
  const Rig rig = unit_triangle();
  // From one metre behind the array, through (0.25, 0.5).
  const Sighting seen = Sight(rig, kOneFace, {0, 0, -1}).look(0, {0.25, 0.5, 1});
  EXPECT_TRUE(seen.faces);
  ASSERT_TRUE(seen.contains);
  EXPECT_NEAR(static_cast<double>(seen.weight[0]), 0.25, 1e-18);
  EXPECT_NEAR(static_cast<double>(seen.weight[1]), 0.25, 1e-18);
  EXPECT_NEAR(static_cast<double>(seen.weight[2]), 0.5, 1e-18);
}

TEST(Sight, TheArrayMayBeBehindTheEye) {
  const Rig rig = unit_triangle();
  // The line, not the ray, meets the triangle: in (0.25, 0.5) again.
  const Sighting seen = Sight(rig, kOneFace, {1.25, 0.5, 1}).look(0, {1, 0, 1});
  ASSERT_TRUE(seen.contains);
  EXPECT_NEAR(static_cast<double>(seen.weight[1]), 0.25, 1e-18);
  EXPECT_NEAR(static_cast<double>(seen.weight[2]), 0.5, 1e-18);
}

TEST(Sight, AwayFromTheAxesDoesNotFace) {
  const Sighting seen = Sight(unit_triangle(), kOneFace, {0.2, 0.2, 1}).look(0, {0, 0, -1});
  EXPECT_TRUE(seen.contains);
  EXPECT_FALSE(seen.faces);
}

TEST(Sight, ParallelToThePlaneHasNoWeight) {
  EXPECT_FALSE(Sight(unit_triangle(), kOneFace, {0.2, 0.2, 1}).look(0, {1, 0, 0}).contains);
}

TEST(Sight, StripsAndPoints) {
  const Rig rig = unit_triangle();
  const Mesh strip{{{{0, 1, MeshFace::kNone}, {0, 1, 0}}}}, point{{{{2, MeshFace::kNone, MeshFace::kNone}, {}}}};
  const Sighting seen = Sight(rig, strip, {0, 0, -1}).look(0, {0.25, 7, 1});
  ASSERT_TRUE(seen.contains);
  EXPECT_NEAR(static_cast<double>(seen.weight[0]), 0.75, 1e-18);
  EXPECT_NEAR(static_cast<double>(seen.weight[1]), 0.25, 1e-18);
  EXPECT_FALSE(Sight(rig, strip, {0, 0, -1}).look(0, {1.25, 0, 1}).contains);
  EXPECT_EQ(Sight(rig, point, {5, 5, 5}).look(0, {0.25, 7, 1}).weight[0], 1);
  EXPECT_FALSE(Sight(rig, point, {5, 5, 5}).look(0, {0.25, 7, -1}).faces);
}

TEST(Sight, AgreesWithTheMeetingPointEverywhere) {
  Random random(1);
  int compared = 0;
  for (int i = 0; i < 2000; i++) {
    const Rig rig = random_rig(random);
    const Mesh mesh = build_mesh(rig);
    const V3 eye = to_v3(random.point_in_box(2));
    const Sight sight(rig, mesh, eye);
    for (size_t f = 0; f < mesh.faces.size(); f++) {
      // Somewhere near the face.
      V3 d = to_v3(random.point_in_box(0.2)) - eye;
      for (int k = 0; k < mesh.faces[f].corners(); k++)
        d = d + (Real{1} / 3) * to_v3(rig.cameras[mesh.faces[f].camera[k]].pose.position);
      if (random.one_in(2)) d = Real{-1} * d;
      const Sighting seen = sight.look(f, d);
      if (mesh.faces[f].corners() != 3 || seen.margin < 1e-9L) continue;
      const auto weights = weights_at_meeting_point(rig, mesh.faces[f], eye, d);
      if (!weights) continue;
      const bool inside = (*weights)[0] >= 0 && (*weights)[1] >= 0 && (*weights)[2] >= 0;
      ASSERT_EQ(inside, seen.contains) << "rig " << i << " face " << f;
      if (!inside) continue;
      compared++;
      for (int k = 0; k < 3; k++) EXPECT_NEAR(static_cast<double>((*weights)[k] - seen.weight[k]), 0, 1e-11);
    }
  }
  EXPECT_GT(compared, 2000);
}

TEST(ReferenceLens, LineOfSightInvertsProjection) {
  Random random(2);
  int inverted = 0;
  for (int i = 0; i < 500; i++) {
    const ReferenceLens lens(random_lens(random, 64, 48));
    for (int j = 0; j < 20; j++) {
      const P2 pixel{random.uniform(0, 63), random.uniform(0, 47)};
      const std::optional<P2> ray = lens.line_of_sight(pixel);
      if (!ray) continue;
      inverted++;
      const std::optional<P2> back = lens.project({3 * ray->x, 3 * ray->y, 3});
      ASSERT_TRUE(back);
      EXPECT_NEAR(static_cast<double>(back->x - pixel.x), 0, 1e-12);
      EXPECT_NEAR(static_cast<double>(back->y - pixel.y), 0, 1e-12);
    }
  }
  EXPECT_GT(inverted, 5000);
}

TEST(ReferenceLens, FoldIsWhereGrowthStops) {
  EXPECT_NEAR(static_cast<double>(ReferenceLens(Lens(LensModel::kSimpleRadial, {1, 0, 0, -1.0 / 3})).fold_radius()), 1,
              1e-15);
  EXPECT_TRUE(std::isinf(ReferenceLens(Lens(LensModel::kRadial, {1, 0, 0, 0.1, 0.1})).fold_radius()));
  // 1 - 3 (0.5) q + 5 (0.1) q^2 = 0 first at q = 1.
  EXPECT_NEAR(static_cast<double>(ReferenceLens(Lens(LensModel::kRadial, {1, 0, 0, -0.5, 0.1})).fold_radius()), 1,
              1e-15);
}

TEST(Render, ValidLostAndDivision) {
  Rig rig = unit_triangle();
  std::vector<Image> images;
  for (const uint8_t value : {30, 90, 210}) {
    images.emplace_back(PixelFamily::kRgb, 32, 32);
    std::fill(images.back().data().begin(), images.back().data().end(), value);
  }
  View view;
  view.width = view.height = 1;
  view.lens = Lens::pinhole(1, -0.25, -0.5);  // the only pixel looks along (0.25, 0.5, 1)
  view.pose.position = {0, 0, -1};
  view.focus.plane = {{0, 0, 1}, -2};  // z = 2: X = (0.75, 1.5, 2)
  Picture picture = render(rig, kOneFace, view, images);
  EXPECT_NEAR(picture.at(0, 0).colour[0], 0.25 * 30 + 0.25 * 90 + 0.5 * 210, 1e-12);
  EXPECT_EQ(picture.at(0, 0).coverage, 1);

  rig.cameras[2].pose.orientation = {0, 0, 1, 0};  // looks backwards: X is behind it
  picture = render(rig, kOneFace, view, images);
  EXPECT_EQ(picture.at(0, 0).lost, 0.5);
  EXPECT_EQ(picture.at(0, 0).coverage, 0.5);
  EXPECT_NEAR(picture.at(0, 0).colour[0], (0.25 * 30 + 0.25 * 90) / 0.5, 1e-12);

  view.focus.plane = {{0, 0, 1}, 2};  // behind the eye: no line of sight meets it at t > 0
  EXPECT_EQ(render(rig, kOneFace, view, images).at(0, 0).owner, Pixel::kNone);
}

TEST(Render, SamplesBilinearly) {
  Rig rig = unit_triangle();
  std::vector<Image> images(3, Image(PixelFamily::kRgb, 32, 32));
  for (int y = 0; y < 32; y++)
    for (int x = 0; x < 32; x++) images[0].pixel(x, y)[1] = static_cast<uint8_t>(4 * x + 2 * y);
  View view;
  view.width = view.height = 32;
  view.lens = Lens::pinhole(16, 15.25, 15.75);  // at camera 0, its picture moved by a quarter of a pixel
  view.focus.plane = {{0, 0, 1}, -5};
  const Picture picture = render(rig, kOneFace, view, images);
  EXPECT_NEAR(picture.at(10, 20).colour[1], 4 * 10.25 + 2 * 19.75, 1e-12);
  EXPECT_NEAR(picture.at(31, 20).colour[1], 4 * 31 + 2 * 19.75, 1e-12);  // 31.25: clamped
}

}  // namespace
}  // namespace lf::reference
