// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <array>
#include <optional>
#include <string_view>

#include <nlohmann/json_fwd.hpp>

#include "base/json_value.h"
#include "base/maths.h"

namespace lf {

// COLMAP's camera models with COLMAP's names. The values are the codes on the wire.
enum class LensModel { kSimplePinhole = 0, kPinhole = 1, kSimpleRadial = 2, kRadial = 3, kOpenCv = 4 };

// Maps camera coordinates to pixels. (0, 0) is the centre of the top-left pixel.
//
// A point (X, Y, Z) with Z > 0 has undistorted normalised coordinates (u, v) = (X/Z, Y/Z). With r^2 = u^2 + v^2, lens
// distortion (COLMAP's models.h, OpenCV's calib3d) gives
//   u' = u (1 + k1 r^2 + k2 r^4) + 2 p1 u v + p2 (r^2 + 2 u^2),  v' = v (1 + ...) + p1 (r^2 + 2 v^2) + 2 p2 u v
// and the pixel is (fx u' + cx, fy v' + cy). At some radius, r (1 + k1 r^2 + k2 r^4) may stop growing, so that rays
// beyond it would fold back into the image. Rays beyond this radius count as outside.
class Lens {
 public:
  static constexpr int kMaxParams = 8;
  static constexpr int kMaxRadialSteps = 100, kMaxNewtonSteps = 50;  // iteration limits of undistort()

  Lens() : Lens(LensModel::kSimplePinhole, {1, 0, 0}) {}
  // Creates a lens from the parameters of a COLMAP model. `params` are in COLMAP's order for the model; further values
  // are ignored. Throws Error ("params[i]: ...") if a value is not finite or a focal length is not positive.
  Lens(LensModel model, const std::array<double, kMaxParams>& params);

  static Lens pinhole(double f, double cx, double cy);
  // Returns a lens with f = (height/2) / tan(fov_y/2) and the principal point in the middle. `fov_y_deg` must be
  // between 0 and 180.
  static Lens from_fov_y(double fov_y_deg, int width, int height);

  LensModel model() const { return model_; }
  const std::array<double, kMaxParams>& params() const { return params_; }
  int num_params() const;
  bool operator==(const Lens& o) const { return model_ == o.model_ && params_ == o.params_; }

  double fx() const { return fx_; }
  double fy() const { return fy_; }
  double cx() const { return cx_; }
  double cy() const { return cy_; }
  double k1() const { return k1_; }
  double k2() const { return k2_; }
  double p1() const { return p1_; }
  double p2() const { return p2_; }
  bool has_distortion() const { return k1_ != 0 || k2_ != 0 || p1_ != 0 || p2_ != 0; }
  Lens shifted(const Vec2& pixels) const;
  // Returns the radius in undistorted coordinates beyond which rays would fold back into the image, and therefore count
  // as outside. The radius is infinite if rays never fold back.
  double max_radius() const { return max_radius_; }

  // Maps undistorted to distorted normalised coordinates. Returns nothing beyond max_radius().
  std::optional<Vec2> distort(const Vec2& undistorted) const;
  // Does the inverse of distort(), accurate to 1e-12 focal lengths. Returns nothing if no ray falls on this position.
  // Adds the number of iterations to *steps, unless null. There are at most kMaxRadialSteps + kMaxNewtonSteps.
  std::optional<Vec2> undistort(const Vec2& distorted, int* steps = nullptr) const;
  // Returns how long unproject() takes for an average pixel of an image: the mean number of iterations, measured at 64
  // pixels. It is 0 for a pinhole.
  double mean_iterations(int width, int height) const;

  // Maps camera coordinates to a pixel position, which may be outside the image. Returns nothing for Z <= 0 or beyond
  // max_radius().
  std::optional<Vec2> project(const Vec3& x_camera) const;
  // Returns the undistorted normalised coordinates (u, v) of a pixel position. The line of sight is (u, v, 1).
  std::optional<Vec2> unproject(const Vec2& pixel) const;

 private:
  LensModel model_;
  std::array<double, kMaxParams> params_{};
  double fx_, fy_, cx_, cy_;
  double k1_ = 0, k2_ = 0, p1_ = 0, p2_ = 0;
  double max_radius_;
};

std::string_view lens_model_name(LensModel model);
std::optional<LensModel> lens_model_from_name(std::string_view name);
std::optional<LensModel> lens_model_from_code(unsigned code);
int lens_model_num_params(LensModel model);
int lens_model_num_focal(LensModel model);  // 1 (f) or 2 (fx, fy); focal lengths come first, then cx, cy

// Reads the members "model" and "params" of a camera or view. Throws Error with the place in the file.
Lens parse_lens(const JsonValue& object);
void put_lens(const Lens& lens, nlohmann::ordered_json& object);

}  // namespace lf
