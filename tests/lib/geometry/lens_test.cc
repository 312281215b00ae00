// SPDX-License-Identifier: LGPL-2.1-or-later
#include "geometry/lens.h"

#include <limits>
#include <random>

#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "support/expect_error.h"

namespace lf {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();

struct Case {
  const char* what;
  Lens lens;
  double max_radius;  // largest valid radius, computed by hand
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
  };
}

TEST(Lens, FoldRadiusIsWhereRadialDistortionStopsGrowing) {
  for (const Case& c : cases()) {
    SCOPED_TRACE(c.what);
    if (std::isinf(c.max_radius)) {
      EXPECT_EQ(c.lens.max_radius(), kInfinity);
      continue;
    }
    EXPECT_NEAR(c.lens.max_radius(), c.max_radius, 1e-12);
    EXPECT_TRUE(c.lens.distort({c.max_radius * (1 - 1e-9), 0}));
    EXPECT_FALSE(c.lens.distort({0, c.max_radius * (1 + 1e-9)}));
    // No ray projects beyond the image of the fold.
    const double edge = c.lens.distort({c.max_radius * (1 - 1e-12), 0})->x;
    EXPECT_TRUE(c.lens.undistort({edge * (1 - 1e-9), 0}));
    EXPECT_FALSE(c.lens.undistort({edge * (1 + 1e-9), 0}));
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
    const Lens lens(kOpenCv, {std::abs(any()), std::abs(any()), any(), any(), any(), any(), any(), any()});
    int steps = 0;
    lens.undistort({any(), any()}, &steps);
    ASSERT_LE(steps, Lens::kMaxRadialSteps + Lens::kMaxNewtonSteps);
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
      EXPECT_ERROR(Lens(kOpenCv, params), "params[" + std::to_string(k) + "]: ");
    }
  EXPECT_ERROR(Lens(kRadial, {1, 0, kInfinity, 0, 0}), "params[2]: ");
  EXPECT_NO_THROW(Lens(kSimplePinhole, {1, 0, 0, std::nan("")})) << "not a parameter of this model";
}

TEST(LensModel, NamesAndCodesAreOneToOne) {
  for (unsigned code = 0; code < 5; code++) {
    const LensModel model = lens_model_from_code(code).value();
    EXPECT_EQ(lens_model_from_name(lens_model_name(model)), model);
  }
  EXPECT_FALSE(lens_model_from_code(5));
  EXPECT_FALSE(lens_model_from_name("FISHEYE"));
  EXPECT_FALSE(lens_model_from_name("radial"));
}

Lens parse(const std::string& text) {
  const std::string name = "f.json";
  const nlohmann::json root = parse_json(text, name);
  return parse_lens(JsonValue(root, name).at("camera"));
}

TEST(LensJson, RoundTripsEveryModelToTheLastBit) {
  for (const LensModel model : {LensModel::kSimplePinhole, LensModel::kPinhole, LensModel::kSimpleRadial,
                                LensModel::kRadial, LensModel::kOpenCv}) {
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
      {R"({"model": "PINHOLE", "params": 7})", {"f.json", "camera.params", "array"}},
      {R"({"model": "PINHOLE", "params": [1, 1, "NaN", 0]})", {"f.json", "camera.params[2]", "finite", "number"}},
      {R"({"model": "PINHOLE", "params": [1, 0, 0, 0]})", {"f.json", "camera.params[1]", "positive"}},
  };
  for (const auto& c : cases) EXPECT_ERROR(parse("{\"camera\": " + c.text + "}"), c.facts);
}

}  // namespace
}  // namespace lf
