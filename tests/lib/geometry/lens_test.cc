// SPDX-License-Identifier: LGPL-2.1-or-later
#include "geometry/lens.h"

#include <nlohmann/json.hpp>

#include "support/expect_error.h"
#include "support/test.h"

namespace lf {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();
constexpr double kFisheyeField = kFisheyeFieldDegrees * M_PI / 180;

struct Case {
  const char* what;
  Lens lens;
  double max_radius;  // largest valid length of (a, b), computed by hand
  double reach;       // undistorted radius limit of the round-trip test
};

// Radii where 1 + 3 k1 q + 5 k2 q^2 = 0, q = r^2.
std::vector<Case> cases() {
  using enum LensModel;
  return {
      {"pinhole", Lens(kPinhole, {500, 400, 320, 240}), kInfinity, 100},
      {"barrel", Lens(kSimpleRadial, {500, 320, 240, -0.2}), std::sqrt(1 / 0.6), 1.29},
      {"strong barrel", Lens(kSimpleRadial, {500, 320, 240, -2}), std::sqrt(1.0 / 6), 0.408},
      {"pincushion", Lens(kRadial, {500, 320, 240, 0.4, 0.1}), kInfinity, 20},
      {"barrel, straightened", Lens(kRadial, {500, 320, 240, -0.2, 0.05}), kInfinity, 20},  // 0.36 < 4 * 0.25
      {"fold by k2", Lens(kRadial, {500, 320, 240, 0.1, -0.2}), std::sqrt((0.3 + std::sqrt(0.09 + 4.0)) / 2), 1.07},
      {"first of two folds", Lens(kRadial, {500, 320, 240, -0.5, 0.1}), 1, 0.999},  // (q - 1)(q - 2) / 2
      {"tangential", Lens(kOpenCv, {500, 480, 320, 240, -0.15, 0.03, 0.001, -0.002}), kInfinity, 1.5},
      {"strong tangential", Lens(kOpenCv, {500, 480, 320, 240, -0.1, 0.1, 0.02, 0.03}), kInfinity, 1},
      {"tangential alone", Lens(kOpenCv, {500, 480, 320, 240, 0, 0, 0.01, 0.01}), kInfinity, 2},
      {"k3", Lens(kFullOpenCv, {500, 480, 320, 240, 0, 0, 0, 0, -1 / 7.0, 0, 0, 0}), 1, 0.999},  // 1 - q^3
      {"rational, always grows", Lens(kFullOpenCv, {500, 480, 320, 240, 0.5, 0, 0, 0, 0, 0.4, 0, 0}), kInfinity, 20},
      // r / (1 + q / 2) has the slope (1 - q / 2) / (1 + q / 2)^2.
      {"rational, decays", Lens(kFullOpenCv, {500, 480, 320, 240, 0, 0, 0, 0, 0, 0.5, 0, 0}), std::sqrt(2), 1.41},
      {"pole", Lens(kFullOpenCv, {500, 480, 320, 240, 0, 0, 0, 0, 0, -1, 0, 0}), std::sqrt(1 - 1e-9), 0.99},
      {"all rational terms", Lens(kFullOpenCv, {500, 480, 320, 240, 0.5, -0.1, 1e-3, -2e-3, 0.02, 0.4, 0.05, 0.01}),
       kInfinity, 1.5},
      {"equidistant", Lens(kOpenCvFisheye, {200, 190, 320, 240, 0, 0, 0, 0}), kFisheyeField, 100},
      {"fisheye", Lens(kOpenCvFisheye, {200, 190, 320, 240, 0.03, -0.01, 0.003, -3e-4}), kFisheyeField, 100},
      {"fisheye that folds", Lens(kSimpleRadialFisheye, {200, 320, 240, -0.3}), std::sqrt(1 / 0.9), 1.75},
      {"radial fisheye", Lens(kRadialFisheye, {200, 320, 240, -0.05, 0.01}), kFisheyeField, 100},
      {"thin prism", Lens(kThinPrismFisheye, {200, 190, 320, 240, 0.03, -0.01, 2e-3, -1e-3, 3e-3, 1e-4, 5e-3, -4e-3}),
       kFisheyeField, 50},
  };
}

TEST(Lens, FoldRadiusIsWhereRadialDistortionStopsGrowing) {
  for (const Case& c : cases()) {
    SCOPED_TRACE(c.what);
    EXPECT_EQ(c.lens.folds(), c.max_radius < (c.lens.distortion().fisheye ? kFisheyeField : kInfinity));
    if (std::isinf(c.max_radius)) {
      EXPECT_EQ(c.lens.max_length(), kInfinity);
      continue;
    }
    EXPECT_NEAR(c.lens.max_length(), c.max_radius, 1e-12);
    if (c.lens.distortion().is_prism) continue;  // these terms move the edge
    const bool fisheye = c.lens.distortion().fisheye;
    const auto pixel_at = [&](double length) {
      return c.lens.project(fisheye ? Vec3(std::sin(length), 0, std::cos(length)) : Vec3(length, 0, 1));
    };
    EXPECT_TRUE(pixel_at(c.max_radius * (1 - 1e-9)));
    EXPECT_FALSE(pixel_at(c.max_radius * (1 + 1e-9)));
    // No ray projects beyond the image of the fold.
    const double edge = pixel_at(c.max_radius * (1 - 1e-12))->x - c.lens.cx();
    EXPECT_TRUE(c.lens.direction({c.lens.cx() + edge * (1 - 1e-9), c.lens.cy()}));
    if (edge > 1e6) continue;  // a pole
    EXPECT_FALSE(c.lens.direction({c.lens.cx() + edge * (1 + 1e-9), c.lens.cy()}));
  }
}

// Lenses from files or the network may have any parameters. The cost per pixel is bounded and known before any pixel is
// computed.
TEST(Lens, StepsAreBoundedAndCounted) {
  using enum LensModel;
  constexpr int kWidth = 4096, kHeight = 2304;
  const auto steps_of = [](const Lens& lens) { return lens.mean_iterations(kWidth, kHeight); };
  EXPECT_EQ(steps_of(Lens::from_fov_y(50, kWidth, kHeight)), 0);
  const Lens ordinary[] = {Lens(kRadial, {3300, 2048, 1152, -0.1, 0.02}),
                           Lens(kRadial, {2048, 2048, 1152, -0.25, 0.05}),
                           Lens(kOpenCv, {3300, 3300, 2048, 1152, -0.1, 0.02, 1e-3, -5e-4})};
  for (const Lens& lens : ordinary) {
    EXPECT_GE(steps_of(lens), 2);
    EXPECT_LE(steps_of(lens), 10) << "converges despite rounding";
  }
  // The first two lenses map no ray to most pixels: these are rejected without iterations.
  EXPECT_LT(steps_of(Lens(kRadial, {4915, 2048, 1152, -1e3, 0})), 2);
  EXPECT_LT(steps_of(Lens(kOpenCv, {30, 30, 2048, 1152, -5, 3, 0.7, -0.9})), 2);
  EXPECT_GT(steps_of(Lens(kOpenCv, {1, 1, 2048, 1152, 1e12, -1e12, 1e9, 1e9})), 30);
  std::mt19937 random(4);
  std::uniform_real_distribution<double> exponent(-8, 12), sign(-1, 1);
  for (int i = 0; i < 20'000; i++) {
    const auto any = [&] { return std::copysign(std::pow(10, exponent(random)), sign(random)); };
    const LensModel models[] = {kOpenCv, kFullOpenCv, kOpenCvFisheye, kThinPrismFisheye};
    const Lens lens(models[i % 4], {std::abs(any()), std::abs(any()), any(), any(), any(), any(), any(), any(), any(),
                                    any(), any(), any()});
    int steps = 0;
    const std::optional<Vec2> ray = lens.undistort({any(), any()}, &steps);
    ASSERT_LE(steps, Lens::kMaxRadialSteps + Lens::kMaxNewtonSteps);
    ASSERT_TRUE(!ray || std::isfinite(ray->x + ray->y));
    const std::optional<Vec2> place = lens.distort({any(), any()});
    ASSERT_FALSE(place && std::isnan(place->x + place->y));
    ASSERT_GE(lens.max_length(), 0);
    ASSERT_GE(lens.steepness(std::abs(any())).least, 0);
  }
  // Products of such coefficients overflow.
  for (const LensModel model : {kFullOpenCv, kThinPrismFisheye, kOpenCvFisheye}) {
    std::array<double, Lens::kMaxParams> params;
    params.fill(1e300);
    const Lens lens(model, params);
    const std::optional<Vec2> ray = lens.undistort({1, 1});
    EXPECT_TRUE(!ray || std::isfinite(ray->x + ray->y));
    EXPECT_FALSE(lens.distort({std::nan(""), 1}));
    EXPECT_TRUE(model != kFullOpenCv || !lens.distort({1, 1}));
  }
}

TEST(Lens, UndistortInvertsDistort) {
  std::mt19937 random(1);
  std::uniform_real_distribution<double> angle(0, 2 * M_PI), share(0, 1);
  for (const Case& c : cases()) {
    SCOPED_TRACE(c.what);
    double worst = 0;
    for (int i = 0; i < 2000; i++) {
      const double r = c.reach * share(random), a = angle(random);
      const Vec2 u(r * std::cos(a), r * std::sin(a));
      const Vec2 d = c.lens.distort(u).value(), back = c.lens.undistort(d).value();
      worst = std::max(worst, glm::length(c.lens.distort(back).value() - d) / (1 + glm::length(d)));
      EXPECT_NEAR(back.x, u.x, 1e-7 * (1 + r));  // near a fold, the inverse is only as precise as its slope
      EXPECT_NEAR(back.y, u.y, 1e-7 * (1 + r));
    }
    EXPECT_LE(worst, 1e-12);
  }
}

TEST(Lens, CentreIsNotDistorted) {
  for (const Case& c : cases()) {
    SCOPED_TRACE(c.what);
    EXPECT_EQ(c.lens.undistort({0, 0}), Vec2(0, 0));
    EXPECT_EQ(c.lens.project({0, 0, 2}), Vec2(320, 240));
  }
}

// Expected values are computed by hand from the formula of COLMAP's OpenCVCameraModel and OpenCV's projectPoints.
TEST(Lens, FollowsTheFormulaOfOpenCv) {
  const Lens lens(LensModel::kOpenCv, {100, 200, 10, 20, 0.1, 0.01, 0.001, 0.002});
  // u = 0.5, v = -0.25: r2 = 0.3125, radial = 1 + 0.03125 + 0.0009765625 = 1.0322265625
  const double u = 0.5 * 1.0322265625 + 2 * 0.001 * -0.125 + 0.002 * (0.3125 + 0.5);
  const double v = -0.25 * 1.0322265625 + 0.001 * (0.3125 + 0.125) + 2 * 0.002 * -0.125;
  const Vec2 pixel = lens.project({1, -0.5, 2}).value();
  EXPECT_NEAR(pixel.x, 100 * u + 10, 1e-13);
  EXPECT_NEAR(pixel.y, 200 * v + 20, 1e-13);
}

// The formulas of COLMAP's models.h, each written out on its own.
Vec2 plain_distort(const Lens& lens, Vec2 u) {
  const auto& p = lens.params();
  const auto at_angle = [&] {
    const long double r = std::hypot(static_cast<long double>(u.x), static_cast<long double>(u.y));
    return r > 0 ? u * static_cast<double>(std::atan(r) / r) : u;
  };
  const auto with_tangential = [](const Vec2& a, double radial, double p1, double p2) {
    const double r2 = a.x * a.x + a.y * a.y;
    return Vec2(a.x * radial + 2 * p1 * a.x * a.y + p2 * (r2 + 2 * a.x * a.x),
                a.y * radial + 2 * p2 * a.x * a.y + p1 * (r2 + 2 * a.y * a.y));
  };
  switch (lens.model()) {
    case LensModel::kOpenCvFisheye: {
      const double theta = std::atan(glm::length(u)), t2 = theta * theta;
      const double distorted =
          theta * (1 + p[4] * t2 + p[5] * t2 * t2 + p[6] * std::pow(t2, 3) + p[7] * std::pow(t2, 4));
      return theta > 0 ? u * (distorted / glm::length(u)) : u;
    }
    case LensModel::kSimpleRadialFisheye: {
      const Vec2 a = at_angle();
      return a * (1 + p[3] * glm::dot(a, a));
    }
    case LensModel::kRadialFisheye: {
      const Vec2 a = at_angle();
      return a * (1 + p[3] * glm::dot(a, a) + p[4] * std::pow(glm::dot(a, a), 2));
    }
    case LensModel::kThinPrismFisheye: {
      const Vec2 a = at_angle();
      const double q = glm::dot(a, a),
                   radial = 1 + p[4] * q + p[5] * q * q + p[8] * std::pow(q, 3) + p[9] * std::pow(q, 4);
      return with_tangential(a, radial, p[6], p[7]) + Vec2(p[10] * q, p[11] * q);
    }
    case LensModel::kFullOpenCv: {
      const double q = glm::dot(u, u);
      const double radial =
          (1 + p[4] * q + p[5] * q * q + p[8] * q * q * q) / (1 + p[9] * q + p[10] * q * q + p[11] * q * q * q);
      return with_tangential(u, radial, p[6], p[7]);
    }
    default: ADD_FAILURE(); return {};
  }
}

TEST(Lens, FollowsTheFormulasOfColmap) {
  std::mt19937 random(5);
  std::uniform_real_distribution<double> share(-1, 1);
  for (const Case& c : cases()) {
    if (!c.lens.distortion().is_general) continue;
    SCOPED_TRACE(c.what);
    for (int i = 0; i < 1000; i++) {
      const double reach = 0.7 * c.reach * std::pow(10, 2 * std::min(share(random), 0.0));
      const Vec2 u(reach * share(random), reach * share(random)), d = plain_distort(c.lens, u);
      const Vec2 pixel = c.lens.project(Vec3(u, 1) * 3.0).value();
      EXPECT_NEAR(pixel.x, c.lens.fx() * d.x + c.lens.cx(), 1e-11 * (1 + std::abs(pixel.x)));
      EXPECT_NEAR(pixel.y, c.lens.fy() * d.y + c.lens.cy(), 1e-11 * (1 + std::abs(pixel.y)));
    }
  }
}

TEST(Lens, FisheyeWithoutDistortionIsEquidistant) {
  using enum LensModel;
  const Lens ideal(kOpenCvFisheye, {100, 100, 320, 240});
  EXPECT_TRUE(ideal.has_distortion());
  for (const double degrees : {0.0, 1e-9, 1.0, 30.0, 60.0, 89.0, 89.9, 89.9999, 90.0, 90.0001, 93.0, 94.9999}) {
    const double angle = degrees * M_PI / 180;
    const Vec3 ray(0.6 * std::sin(angle), -0.8 * std::sin(angle), std::cos(angle));
    const Vec2 pixel = ideal.project(3.0 * ray).value();
    EXPECT_NEAR(pixel.x, 320 + 60 * angle, 1e-9);
    EXPECT_NEAR(pixel.y, 240 - 80 * angle, 1e-9);
    EXPECT_LE(glm::length(ideal.direction(pixel).value() - ray), 1e-12);
    ASSERT_EQ(ideal.unproject(pixel).has_value(), degrees < 90);
    if (degrees >= 90) continue;
    EXPECT_NEAR(std::atan(glm::length(ideal.unproject(pixel).value())), angle, 1e-12);
  }
  for (const Lens& same : {Lens(kSimpleRadialFisheye, {100, 320, 240}), Lens(kRadialFisheye, {100, 320, 240}),
                           Lens(kThinPrismFisheye, {100, 100, 320, 240})})
    EXPECT_EQ(same.project({1, 2, 1}), ideal.project({1, 2, 1}));
  EXPECT_FALSE(Lens(kFullOpenCv, {100, 100, 320, 240}).has_distortion());
  EXPECT_EQ(Lens(kFullOpenCv, {100, 100, 320, 240}).project({1, 2, 1}),
            Lens::pinhole(100, 320, 240).project({1, 2, 1}));
}

// The circle of a fisheye image that is larger than its field of view: pixels beyond 95 degrees have no direction, and
// pixels beyond 90 degrees no ray (u, v, 1).
TEST(Lens, FisheyeFieldEndsAt95Degrees) {
  const Lens lens(LensModel::kOpenCvFisheye, {90, 90, 199.5, 149.5, 0.01, 0, 0, 0});
  const auto radius_of = [](double angle) { return 90 * (angle + 0.01 * std::pow(angle, 3)); };
  const double edge = radius_of(M_PI / 2), end = radius_of(kFisheyeField);
  int inside = 0;
  for (int y = 0; y < 300; y++)
    for (int x = 0; x < 400; x++) {
      const double radius = std::hypot(x - 199.5, y - 149.5);
      const std::optional<Vec2> ray = lens.unproject({x, y});
      ASSERT_EQ(ray.has_value(), radius < edge) << x << ", " << y;
      ASSERT_LE(ray ? glm::length(*ray) : 0, Lens::kMaxSlope);
      const std::optional<Vec3> direction = lens.direction({x, y});
      ASSERT_EQ(direction.has_value(), radius < end) << x << ", " << y;
      inside += direction.has_value();
      if (!direction) continue;
      ASSERT_NEAR(glm::length(*direction), 1, 1e-15);
      ASSERT_LE(glm::length(lens.project(*direction).value() - Vec2(x, y)), 1e-10);
    }
  EXPECT_GT(inside, 70'000);
  const double t = std::tan(5 * M_PI / 180);  // the angle is behind the plane Z = 0
  for (const auto& [point, seen] : std::initializer_list<std::pair<Vec3, bool>>{{{1, 0, 0}, true},
                                                                                {{1, 0, 1e-7}, true},
                                                                                {{0, -1e-3, -0.999e-3 * t}, true},
                                                                                {{0, -1e9, -1.001e9 * t}, false},
                                                                                {{1, 0, -1}, false},
                                                                                {{0, 0, -1}, false},
                                                                                {{0, 0, 0}, false},
                                                                                {{std::nan(""), 0, 1}, false},
                                                                                {{0, 1, std::nan("")}, false}})
    EXPECT_EQ(lens.project(point).has_value(), seen) << point.x << " " << point.y << " " << point.z;
  // A lens that folds behind the plane Z = 0: 1 = 3 |k1| angle^2.
  const double fold = 93 * M_PI / 180;
  const Lens folding(LensModel::kSimpleRadialFisheye, {100, 0, 0, -1 / (3 * fold * fold)});
  EXPECT_TRUE(folding.folds());
  EXPECT_NEAR(folding.max_length(), fold, 1e-12);
  for (const double sign : {-1, 1}) {
    const double angle = fold + sign * 1e-9;
    EXPECT_EQ(folding.project({std::sin(angle), 0, std::cos(angle)}).has_value(), sign < 0);
  }
}

// Derivatives of the distorted coordinates, by differences along random lines.
TEST(Lens, SteepnessBoundsTheDerivatives) {
  std::mt19937 random(6);
  std::uniform_real_distribution<double> angle(0, 2 * M_PI), share(0, 1);
  for (const Case& c : cases()) {
    SCOPED_TRACE(c.what);
    const bool fisheye = c.lens.distortion().fisheye;
    const double reach = std::min(fisheye ? std::atan(c.reach) : c.reach, 1.4);
    // (a, b) are the angle of the ray for a fisheye lens.
    const auto distorted = [&](const Vec2& ab) {
      const double length = glm::length(ab);
      const auto d = c.lens.distort(fisheye && length > 0 ? ab * (std::tan(length) / length) : ab);
      EXPECT_TRUE(d) << length;
      return d.value_or(Vec2(0, 0));
    };
    const Lens::Steepness bound = c.lens.steepness(glm::length(distorted({reach, 0})));
    double first = 0, second = 0, third = 0, least = 1e9;
    for (int i = 0; i < 2000; i++) {
      constexpr double kStep = 1e-3;
      const double r = (reach - 2 * kStep) * share(random), place = angle(random), along = angle(random);
      const Vec2 at(r * std::cos(place), r * std::sin(place)), step(kStep * std::cos(along), kStep * std::sin(along));
      const Vec2 f[5] = {distorted(at - 2.0 * step), distorted(at - step), distorted(at), distorted(at + step),
                         distorted(at + 2.0 * step)};
      first = std::max(first, glm::length(f[3] - f[1]) / (2 * kStep));
      least = std::min(least, glm::length(f[3] - f[1]) / (2 * kStep));
      second = std::max(second, glm::length(f[3] - 2.0 * f[2] + f[1]) / std::pow(kStep, 2));
      third = std::max(third, glm::length(f[4] - 2.0 * f[3] + 2.0 * f[1] - f[0]) / (2 * std::pow(kStep, 3)));
    }
    EXPECT_LE(first, bound.first);
    EXPECT_GE(least, bound.least);
    EXPECT_LE(second, bound.second + 1e-6);
    EXPECT_LE(third, bound.third + 1e-4);
    EXPECT_LE(bound.third, 100 * third + 1e-4) << "useless";
  }
}

TEST(Lens, ProjectsAndUnprojects) {
  const Lens lens(LensModel::kRadial, {400, 159.5, 119.5, -0.15, 0.03});
  EXPECT_FALSE(lens.project({0, 0, 0}));
  EXPECT_FALSE(lens.project({0, 0, -1}));
  EXPECT_FALSE(lens.project({1, 1, std::nan("")}));
  for (const Vec2& pixel : {Vec2(-0.5, -0.5), Vec2(319.5, 239.5), Vec2(159.5, 119.5), Vec2(0, 239)}) {
    const Vec2 back = lens.project(Vec3(lens.unproject(pixel).value(), 1) * 7.0).value();
    EXPECT_NEAR(back.x, pixel.x, 1e-10);
    EXPECT_NEAR(back.y, pixel.y, 1e-10);
  }
}

TEST(Lens, SimpleModelsAreSpecialCases) {
  const Lens general(LensModel::kOpenCv, {400, 400, 160, 120, -0.15, 0, 0, 0});
  EXPECT_EQ(Lens(LensModel::kSimpleRadial, {400, 160, 120, -0.15}).project({0.3, 0.2, 1}),
            general.project({0.3, 0.2, 1}));
  const Lens no_distortion(LensModel::kOpenCv, {400, 400, 160, 120});
  EXPECT_FALSE(no_distortion.has_distortion());
  EXPECT_EQ(Lens::pinhole(400, 160, 120).project({0.3, 0.2, 1}), no_distortion.project({0.3, 0.2, 1}));
}

TEST(Lens, FieldOfViewGivesFocalLengthAndMiddle) {
  const Lens lens = Lens::from_fov_y(90, 640, 480);
  EXPECT_NEAR(lens.fx(), 240, 1e-12);
  EXPECT_EQ(lens.cx(), 319.5);
  EXPECT_EQ(lens.cy(), 239.5);
  EXPECT_NO_THROW(Lens::from_fov_y(1e-3, 1, 1));
  EXPECT_NO_THROW(Lens::from_fov_y(179.999, 8192, 8192));
  for (const double bad : {0.0, -1.0, 180.0, std::nan(""), kInfinity, -kInfinity})
    EXPECT_ERROR(Lens::from_fov_y(bad, 4, 4), "fov_y: ");
}

TEST(Lens, RefusesBadParametersByName) {
  using enum LensModel;
  EXPECT_ERROR(Lens(kSimplePinhole, {0, 1, 1}), "params[0]: ");
  EXPECT_ERROR(Lens(kSimplePinhole, {-1, 1, 1}), "params[0]: ");
  EXPECT_ERROR(Lens(kPinhole, {1, 0, 1, 1}), "params[1]: ");
  for (const double bad : {std::nan(""), kInfinity, -kInfinity})
    for (size_t k = 0; k < Lens::kMaxParams; k++) {
      std::array<double, Lens::kMaxParams> params{100, 100, 50, 50, 0, 0, 0, 0};
      params[k] = bad;
      EXPECT_ERROR(Lens(kFullOpenCv, params), "params[" + std::to_string(k) + "]: ");
    }
  EXPECT_ERROR(Lens(kRadial, {1, 0, kInfinity, 0, 0}), "params[2]: ");
  EXPECT_NO_THROW(Lens(kSimplePinhole, {1, 0, 0, std::nan("")})) << "not a parameter of this model";
}

TEST(LensModel, NamesAndCodesAreOneToOne) {
  for (unsigned code = 0; code < 10; code++) {
    const LensModel model = lens_model_from_code(code).value();
    EXPECT_EQ(lens_model_from_name(lens_model_name(model)), model);
  }
  EXPECT_FALSE(lens_model_from_code(10));
  EXPECT_FALSE(lens_model_from_name("FISHEYE"));
  EXPECT_FALSE(lens_model_from_name("radial"));
}

Lens parse(const std::string& text) {
  const std::string name = "f.json";
  const nlohmann::json root = parse_json(text, name);
  return parse_lens(JsonValue(root, name).at("camera"));
}

TEST(LensJson, RoundTripsEveryModelToTheLastBit) {
  for (const LensModel model :
       {LensModel::kSimplePinhole, LensModel::kPinhole, LensModel::kSimpleRadial, LensModel::kRadial,
        LensModel::kOpenCv, LensModel::kOpenCvFisheye, LensModel::kFullOpenCv, LensModel::kSimpleRadialFisheye,
        LensModel::kRadialFisheye, LensModel::kThinPrismFisheye}) {
    std::array<double, Lens::kMaxParams> params{};
    for (int i = 0; i < lens_model_num_params(model); i++) params[i] = 1 / (3.0 + i);
    const Lens lens(model, params);
    nlohmann::ordered_json object;
    put_lens(lens, object);
    EXPECT_EQ(parse("{\"camera\": " + object.dump() + "}"), lens);
  }
}

TEST(LensJson, ErrorsNameThePlace) {
  const InvalidText cases[] = {
      {R"({"params": [1, 0, 0]})", {"f.json", "camera", "\"model\"", "missing"}},
      {R"({"model": "RADIAL"})", {"f.json", "camera", "\"params\"", "missing"}},
      {R"({"model": 3, "params": []})", {"f.json", "camera.model", "string"}},
      {R"({"model": "THIN_PRISM", "params": []})",
       {"f.json", "camera.model", "THIN_PRISM", "SIMPLE_PINHOLE", " PINHOLE", "SIMPLE_RADIAL", " RADIAL", "OPENCV"}},
      {R"({"model": "RADIAL", "params": [1, 0, 0, 0]})", {"f.json", "camera.params", "RADIAL", "5 numbers", "4"}},
      {R"({"model": "FULL_OPENCV", "params": [1, 1, 0, 0, 0, 0, 0, 0]})",
       {"f.json", "camera.params", "FULL_OPENCV", "12 numbers", "8"}},
      {R"({"model": "OPENCV_FISHEYE", "params": [1, -1, 0, 0, 0, 0, 0, 0]})",
       {"f.json", "camera.params[1]", "positive"}},
      {R"({"model": "PINHOLE", "params": 7})", {"f.json", "camera.params", "array"}},
      {R"({"model": "PINHOLE", "params": [1, 1, "NaN", 0]})", {"f.json", "camera.params[2]", "finite", "number"}},
      {R"({"model": "PINHOLE", "params": [1, 0, 0, 0]})", {"f.json", "camera.params[1]", "positive"}},
  };
  for (const auto& c : cases) EXPECT_ERROR(parse("{\"camera\": " + c.text + "}"), c.facts);
}

}  // namespace
}  // namespace lf
