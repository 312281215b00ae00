// SPDX-License-Identifier: LGPL-2.1-or-later
#include "focus/depth_ambiguity.h"

#include "support/rigs.h"
#include "support/test.h"

namespace lf {
namespace other_depths_test {

constexpr int kColumns = 12, kRows = 8, kNodes = kColumns * kRows;
constexpr double kApart = 0.1;  // 1/m: 25.5 levels of a range of 1/m

View view_of(double x = 0) {
  constexpr int kWidth = kColumns * FocalMap::kMinStep, kHeight = kRows * FocalMap::kMinStep;
  return {kWidth,
          kHeight,
          Lens::from_fov_y(40, kWidth, kHeight),
          {{x, 0, 0}},
          {{}, test::level_surface(kWidth, kHeight, 0, 1, 0)}};
}

PhotoConsistency seen(int luma, int apart, int weight = PhotoConsistency::kWeightOne) {
  PhotoConsistency sum, camera;
  sum.reset(kColumns, kRows);
  for (const int value : {luma - apart, luma + apart}) {
    camera.reset(kColumns, kRows);
    const auto half = static_cast<uint16_t>(weight / 2);
    camera.weight.assign(kNodes, half);
    camera.luma.assign(kNodes, PhotoConsistency::luma_of(half, value));
    camera.square.assign(kNodes, PhotoConsistency::square_of(camera.luma[0], value));
    sum.add(camera);
  }
  return sum;
}

std::vector<uint8_t> at(uint8_t level) { return std::vector<uint8_t>(kNodes, level); }

struct Plane {
  uint8_t level;
  PhotoConsistency moments;
};

DepthAmbiguity searched(const std::vector<Plane>& planes, const View& view = view_of()) {
  std::vector<std::vector<uint8_t>> levels{at(0), at(0)};
  std::vector<PhotoConsistency> moments{seen(100, 30), seen(100, 30)};  // the surface, the viewer's plane
  for (const Plane& plane : planes) {
    levels.push_back(at(plane.level));
    moments.push_back(plane.moments);
  }
  DepthAmbiguity others(kApart);
  others.add(view, levels, moments, {1, 2});
  return others;
}

DepthAmbiguity::Errors errors_of(const DepthAmbiguity& others, const View& view = view_of()) {
  return others.errors(view, at(100), seen(120, 2), seen(100, 30));
}

TEST(DepthAmbiguity, NoErrorWithoutOtherDepths) {
  const DepthAmbiguity::Errors errors =
      errors_of(searched({{10, seen(90, 40)}, {100, seen(120, 2)}, {200, seen(60, 50)}}));
  EXPECT_EQ(errors.known, 1);
  EXPECT_NEAR(errors.surface_disagrees, 4, 2);
  EXPECT_NEAR(errors.plane_disagrees, 900, 20);
  EXPECT_LT(errors.surface, 0.1 * errors.plane);
}

TEST(DepthAmbiguity, OtherDepthMayBeRight) {
  const DepthAmbiguity::Errors errors =
      errors_of(searched({{10, seen(90, 40)}, {100, seen(120, 2)}, {200, seen(70, 2)}}));
  EXPECT_NEAR(errors.surface, 50 * 50, 200) << "120 instead of possibly 70";
  EXPECT_NEAR(errors.plane, 30 * 30, 100) << "the plane shows 100 there";
}

TEST(DepthAmbiguity, DepthsBesideTheSurfaceAreTheSurface) {
  const DepthAmbiguity::Errors errors =
      errors_of(searched({{10, seen(90, 40)}, {100, seen(120, 2)}, {120, seen(70, 2)}}));
  EXPECT_LT(errors.surface, 10);
}

TEST(DepthAmbiguity, EqualPicturesDoNoHarm) {
  const DepthAmbiguity::Errors errors = errors_of(searched({{100, seen(120, 2)}, {200, seen(120, 2)}}));
  EXPECT_LT(errors.surface, 10);
  EXPECT_GT(errors.plane, 300);
}

TEST(DepthAmbiguity, HypothesesOfFewerCamerasDoNotCount) {
  const PhotoConsistency half = seen(70, 0, PhotoConsistency::kWeightOne / 2 + 1000);
  const DepthAmbiguity::Errors errors = errors_of(searched({{100, seen(120, 2)}, {200, half}}));
  EXPECT_LT(errors.surface, 10);
}

// Most of a view may lie outside the cameras' coverage.
TEST(DepthAmbiguity, KnownPartIsAFractionOfTheVisibleNodes) {
  const auto cut = [](PhotoConsistency moments) {
    for (std::vector<uint16_t>* sum : {&moments.weight, &moments.luma, &moments.square})
      std::fill(sum->begin() + kColumns, sum->end(), uint16_t{0});
    return moments;
  };
  const DepthAmbiguity others = searched({{100, seen(120, 2)}, {200, seen(70, 2)}});
  const DepthAmbiguity::Errors errors = others.errors(view_of(), at(100), cut(seen(120, 2)), cut(seen(100, 30)));
  EXPECT_EQ(errors.known, 1);
  EXPECT_GT(errors.surface, 1000);
}

TEST(DepthAmbiguity, OrderOfPlanesDoesNotMatter) {
  const DepthAmbiguity::Errors errors =
      errors_of(searched({{100, seen(120, 4)}, {200, seen(70, 2)}, {110, seen(120, 1)}}));
  EXPECT_GT(errors.surface, 1000);
  DepthAmbiguity later = searched({{200, seen(70, 2)}, {190, seen(71, 3)}});
  const std::vector<std::vector<uint8_t>> levels{at(0), at(0), at(100), at(180)};
  const std::vector<PhotoConsistency> moments{seen(100, 30), seen(100, 30), seen(120, 1), seen(72, 9)};
  later.add(view_of(), levels, moments, {1, 2});
  EXPECT_GT(errors_of(later).surface, 1000) << "keeps earlier results";
}

TEST(DepthAmbiguity, OtherViewsAndScenesAreUnknown) {
  DepthAmbiguity others = searched({{100, seen(120, 2)}, {200, seen(70, 2)}});
  EXPECT_EQ(errors_of(others, view_of(0.1)).known, 0);
  EXPECT_EQ(others.errors(view_of(), at(100), seen(120, 2), seen(150, 30)).known, 0) << "the plane showed 100";
  EXPECT_EQ(others.errors(view_of(), at(100), seen(120, 2), seen(107, 30)).known, 1) << "cameras were matched";
  others.clear();
  EXPECT_EQ(errors_of(others).known, 0);
}

TEST(DepthAmbiguity, DepthsOutsideTheSceneCanBeDiscarded) {
  // Levels of 1/255 1/m. The best depth is outside the scene, the second is inside.
  const std::vector<Plane> planes{{100, seen(120, 2)}, {200, seen(70, 1)}};
  DepthAmbiguity others = searched(planes);
  EXPECT_GT(errors_of(others).surface, 1000);
  others.forget_beyond(0.3, 0.7);
  EXPECT_EQ(errors_of(others).known, 1);
  EXPECT_LT(errors_of(others).surface, 10);
  others = searched({{100, seen(120, 2)}, {20, seen(70, 2)}});
  others.forget_beyond(0.3, 0.7);
  EXPECT_LT(errors_of(others).surface, 10);
  others = searched(planes);
  others.forget_beyond(0.3, 0.8);
  EXPECT_GT(errors_of(others).surface, 1000) << "keeps depths near the scene";
}

TEST(DepthAmbiguity, BrightnessChangesAreTolerated) {
  const DepthAmbiguity others = searched({{200, seen(100, 2)}});
  const DepthAmbiguity::Errors errors = others.errors(view_of(), at(100), seen(110, 2), seen(110, 30));
  EXPECT_LT(errors.surface, 10);
}

}  // namespace other_depths_test
}  // namespace lf
