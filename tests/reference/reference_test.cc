// SPDX-License-Identifier: LGPL-2.1-or-later
#include "base/text.h"
#include "composite/still.h"
#include "reference/float_renderer.h"
#include "reference/generators.h"
#include "reference/renderer.h"
#include "support/test.h"

namespace lf::reference {
namespace {

// Checks the reference in cases with results known by hand.
Rig unit_triangle() {
  Rig rig;
  for (const Vec3& position : {Vec3(0, 0, 0), Vec3(1, 0, 0), Vec3(0, 1, 0)})
    rig.cameras.push_back(make_camera(static_cast<uint32_t>(rig.cameras.size()), 32, 32, Lens::pinhole(16, 15.5, 15.5),
                                      {position, {1, 0, 0, 0}}));
  rig.topology = {Topology::Type::kTriangles, 0, 0, {{0, 1, 2}}};
  return rig;
}
const Mesh kOneFace{{{{0, 1, 2}, {}}}};

TEST(ReferenceWeights, WeightsAreBarycentricCoordinates) {
  const Rig rig = unit_triangle();
  // One metre behind the array, looking through (0.25, 0.5).
  const Sighting seen = Sight(rig, kOneFace, {0, 0, -1}).look(0, {0.25, 0.5, 1});
  EXPECT_TRUE(seen.faces);
  ASSERT_TRUE(seen.contains);
  EXPECT_NEAR(static_cast<double>(seen.weight[0]), 0.25, 1e-18);
  EXPECT_NEAR(static_cast<double>(seen.weight[1]), 0.25, 1e-18);
  EXPECT_NEAR(static_cast<double>(seen.weight[2]), 0.5, 1e-18);
}

TEST(ReferenceWeights, ArrayMayBeBehindTheEye) {
  const Rig rig = unit_triangle();
  // The line, not the ray, meets the triangle: in (0.25, 0.5) again.
  const Sighting seen = Sight(rig, kOneFace, {1.25, 0.5, 1}).look(0, {1, 0, 1});
  ASSERT_TRUE(seen.contains);
  EXPECT_NEAR(static_cast<double>(seen.weight[1]), 0.25, 1e-18);
  EXPECT_NEAR(static_cast<double>(seen.weight[2]), 0.5, 1e-18);
}

TEST(ReferenceWeights, DirectionsAwayFromTheAxesDoNotFace) {
  const Sighting seen = Sight(unit_triangle(), kOneFace, {0.2, 0.2, 1}).look(0, {0, 0, -1});
  EXPECT_TRUE(seen.contains);
  EXPECT_FALSE(seen.faces);
}

TEST(ReferenceWeights, ParallelRaysHaveNoWeight) {
  EXPECT_FALSE(Sight(unit_triangle(), kOneFace, {0.2, 0.2, 1}).look(0, {1, 0, 0}).contains);
}

TEST(ReferenceWeights, StripsAndPoints) {
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

TEST(ReferenceWeights, AgreesWithTheIntersectionEverywhere) {
  Random random(1);
  int compared = 0;
  for (int i = 0; i < 2000; i++) {
    const Rig rig = random_rig(random);
    const Mesh mesh = build_mesh(rig);
    const V3 eye = to_v3(random.point_in_box(2));
    const Sight sight(rig, mesh, eye);
    for (size_t f = 0; f < mesh.faces.size(); f++) {
      // A direction near the face.
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

TEST(ReferenceLens, FoldIsAtTheMaximum) {
  EXPECT_NEAR(static_cast<double>(ReferenceLens(Lens(LensModel::kSimpleRadial, {1, 0, 0, -1.0 / 3})).longest()), 1,
              1e-15);
  EXPECT_TRUE(std::isinf(ReferenceLens(Lens(LensModel::kRadial, {1, 0, 0, 0.1, 0.1})).longest()));
  // 1 - 3 (0.5) q + 5 (0.1) q^2 = 0 first at q = 1.
  EXPECT_NEAR(static_cast<double>(ReferenceLens(Lens(LensModel::kRadial, {1, 0, 0, -0.5, 0.1})).longest()), 1, 1e-15);
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

  rig.cameras[2].pose.orientation = {0, 0, 1, 0};  // looks backwards: X is behind the camera
  picture = render(rig, kOneFace, view, images);
  EXPECT_EQ(picture.at(0, 0).lost, 0.5);
  EXPECT_EQ(picture.at(0, 0).coverage, 0.5);
  EXPECT_NEAR(picture.at(0, 0).colour[0], (0.25 * 30 + 0.25 * 90) / 0.5, 1e-12);

  view.focus.plane = {{0, 0, 1}, 2};  // no line of sight meets this plane at t > 0
  EXPECT_EQ(render(rig, kOneFace, view, images).at(0, 0).owner, Pixel::kNone);
}

TEST(Render, SamplesBilinearly) {
  Rig rig = unit_triangle();
  std::vector<Image> images(3, Image(PixelFamily::kRgb, 32, 32));
  for (int y = 0; y < 32; y++)
    for (int x = 0; x < 32; x++) images[0].pixel(x, y)[1] = static_cast<uint8_t>(4 * x + 2 * y);
  View view;
  view.width = view.height = 32;
  view.lens = Lens::pinhole(16, 15.25, 15.75);  // at camera 0, its image shifted by a quarter of a pixel
  view.focus.plane = {{0, 0, 1}, -5};
  const Picture picture = render(rig, kOneFace, view, images);
  EXPECT_NEAR(picture.at(10, 20).colour[1], 4 * 10.25 + 2 * 19.75, 1e-12);
  EXPECT_NEAR(picture.at(31, 20).colour[1], 4 * 31 + 2 * 19.75, 1e-12);  // 31.25: clamped
}

}  // namespace
}  // namespace lf::reference

namespace lf {
namespace {

FloatStill flat(PixelFamily family, int width, int height, double value) {
  FloatStill still{family, width, height};
  still.colour.assign(packed_size(family, width, height), value);
  still.valid.assign(static_cast<size_t>(width) * height, 1);
  still.lost.assign(still.valid.size(), 0);
  return still;
}

TEST(ExactQuality, ErrorsAreExact) {
  FloatStill exact = flat(PixelFamily::kRgb, 2, 2, 0.25);
  exact.colour[5] = 3;
  const ExactQuality quality = compare(Image(PixelFamily::kRgb, 2, 2), exact);
  EXPECT_EQ(quality.max_error, 3);
  EXPECT_NEAR(quality.psnr_db, 10 * std::log10(255 * 255 * 12 / (11 * 0.0625 + 9)), 1e-9);
  EXPECT_EQ(quality.coverage, 1);
}

TEST(ExactQuality, CountsOnlyCoveredPixels) {
  FloatStill exact = flat(PixelFamily::kRgb, 2, 1, 0);
  exact.colour[3] = 99;
  exact.valid[1] = 0.9;
  const ExactQuality quality = compare(Image(PixelFamily::kRgb, 2, 1), exact);
  EXPECT_EQ(quality.max_error, 0);
  EXPECT_EQ(quality.psnr_db, INFINITY);
  EXPECT_EQ(quality.coverage, 0.5);
  exact.valid[0] = 0;
  EXPECT_TRUE(std::isnan(compare(Image(PixelFamily::kRgb, 2, 1), exact).max_error));
}

TEST(ExactQuality, ChromaSampleNeedsAllItsPixels) {
  FloatStill exact = flat(PixelFamily::kI420, 4, 2, 0);
  exact.colour[8 + 1] = 10;  // Cb of the right half
  EXPECT_EQ(compare(Image(PixelFamily::kI420, 4, 2), exact).max_error, 10);
  exact.valid[3] = 0.5;
  EXPECT_EQ(compare(Image(PixelFamily::kI420, 4, 2), exact).max_error, 0);
}

TEST(ExactQuality, DifferentSizesAreAnError) {
  EXPECT_THROW(compare(Image(PixelFamily::kRgb, 2, 1), flat(PixelFamily::kRgb, 1, 2, 0)), Error);
  EXPECT_THROW(compare(Image(PixelFamily::kRgb, 2, 2), flat(PixelFamily::kI420, 2, 2, 0)), Error);
}

// 2x2 cameras that look at a plane 2 m away; the view may extend beyond their images.
class FloatStillTest : public testing::Test {
 protected:
  FloatStillTest() : rig_(make_grid_rig({2, 2, 0.2, 50, 40, 30})), mesh_(build_mesh(rig_)) {
    view_.width = 31;  // odd: chroma extends over the edge
    view_.height = 25;
    view_.lens = Lens::from_fov_y(40, view_.width, view_.height);
    view_.pose.position = {0, 0, 0.1};
    view_.focus.plane = plane_through({0, 0, 2}, {0, 0, -1});
  }

  Image image(PixelFamily family, CameraIndex camera) const {
    Image image(family, 40, 30);
    for (size_t i = 0; i < image.data().size(); i++) image.data()[i] = static_cast<uint8_t>(i * (7 + camera) % 251);
    return image;
  }
  CameraImages images(PixelFamily family) const {
    return [this, family, kept = Image()](CameraIndex camera) mutable -> const Image& {
      return kept = image(family, camera);
    };
  }
  FloatStill exact(PixelFamily family) const {
    const ViewPlan plan(rig_, mesh_, view_);
    return render_float_still(rig_, plan, FaceIdMap(plan, {0, 0, view_.width, view_.height}), family, images(family));
  }

  Rig rig_;
  Mesh mesh_;
  View view_;
};

TEST_F(FloatStillTest, RoundsToTheStill) {
  for (const PixelFamily family : {PixelFamily::kRgb, PixelFamily::kI420}) {
    const Still still = render_still(rig_, mesh_, view_, images(family));
    const ExactQuality quality = compare(still.picture, exact(family));
    EXPECT_LE(quality.max_error, 1);
    EXPECT_GT(quality.max_error, 0);
    EXPECT_GT(quality.psnr_db, 55);
    EXPECT_GT(quality.coverage, 0.8);
  }
}

TEST_F(FloatStillTest, MissingWeightIsNormalisedInEveryPlane) {
  view_.lens = Lens::from_fov_y(58, view_.width, view_.height);
  for (const PixelFamily family : {PixelFamily::kRgb, PixelFamily::kI420}) {
    const ViewPlan plan(rig_, mesh_, view_);
    Image grey(family, 40, 30);
    std::fill(grey.data().begin(), grey.data().end(), uint8_t{77});
    const FloatStill still = render_float_still(rig_, plan, FaceIdMap(plan, {0, 0, view_.width, view_.height}), family,
                                                [&](CameraIndex) -> const Image& { return grey; });
    ASSERT_GT(*std::max_element(still.lost.begin(), still.lost.end()), 0.1);
    const size_t pixels = still.valid.size();
    for (size_t i = 0; i < pixels; i++) {
      ASSERT_NEAR(still.valid[i] + still.lost[i], 1, 1e-6);
      if (still.valid[i] < 0.01) continue;
      ASSERT_NEAR(still.colour[family == PixelFamily::kRgb ? 3 * i : i], 77, 1e-3);
    }
    if (family == PixelFamily::kRgb) continue;
    for (size_t i = pixels; i < still.colour.size(); i++)
      if (std::abs(still.colour[i] - 128) > 1e-6) {  // otherwise no weight is left
        ASSERT_NEAR(still.colour[i], 77, 1e-3);
      }
  }
}

TEST_F(FloatStillTest, ImagesOfAnotherFamilyAreAnError) {
  const ViewPlan plan(rig_, mesh_, view_);
  const FaceIdMap owners(plan, {0, 0, view_.width, view_.height});
  EXPECT_THROW(render_float_still(rig_, plan, owners, PixelFamily::kI420, images(PixelFamily::kRgb)), Error);
}

}  // namespace
}  // namespace lf
