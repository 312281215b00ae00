// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <array>
#include <cmath>
#include <optional>
#include <string_view>

#include <nlohmann/json_fwd.hpp>

#include "base/json_value.h"
#include "base/maths.h"

namespace lf {

// COLMAP's camera models with COLMAP's names. The values are the codes on the wire.
enum class LensModel {
  kSimplePinhole = 0,
  kPinhole = 1,
  kSimpleRadial = 2,
  kRadial = 3,
  kOpenCv = 4,
  kOpenCvFisheye = 5,
  kFullOpenCv = 6,
  kSimpleRadialFisheye = 7,
  kRadialFisheye = 8,
  kThinPrismFisheye = 9
};

// The field of a fisheye lens ends 95 degrees from its axis, and the value is tan^2 of half this angle. With a larger
// field, a polynomial for the angle would need more terms for the same precision.
inline constexpr double kFisheyeFieldDegrees = 95, kFisheyeLimit = 1.19095424450605993;

// The distortion of a lens, in a form that covers all models. Undistorted normalised coordinates (u, v) = (X/Z, Y/Z)
// become (a, b) = (u, v), or for a fisheye lens (a, b) = (X, Y) angle / R. Here R^2 = X^2 + Y^2, and `angle` is the
// angle between the ray and the axis, atan2(R, Z). With q = a^2 + b^2, the distorted coordinates are
//   a' = a g + 2 p1 a b + p2 (q + 2 a^2) + s1 q,  b' = b g + p1 (q + 2 b^2) + 2 p2 a b + s2 q,
//   g = (1 + k[0] q + k[1] q^2 + k[2] q^3 + k[3] q^4) / (1 + d[0] q + d[1] q^2 + d[2] q^3).
template <typename T>
struct Distortion {
  bool fisheye = false;
  std::array<T, 4> k{};
  std::array<T, 3> d{};
  T p1 = 0, p2 = 0, s1 = 0, s2 = 0;
  // Largest u^2 + v^2, or for a fisheye lens the largest tan^2(angle / 2). Rays beyond it count as outside.
  T limit = 0;
  // Which terms are not 0. is_general: the lens needs more than the terms k[0], k[1], p1 and p2 of the model OPENCV.
  bool is_general = false, is_rational = false, is_tangential = false, is_prism = false;

  template <typename To>
  Distortion<To> as() const {
    Distortion<To> to{.fisheye = fisheye};
    to.is_general = is_general, to.is_rational = is_rational;
    to.is_tangential = is_tangential, to.is_prism = is_prism;
    for (size_t i = 0; i < k.size(); i++) to.k[i] = static_cast<To>(k[i]);
    for (size_t i = 0; i < d.size(); i++) to.d[i] = static_cast<To>(d[i]);
    to.p1 = static_cast<To>(p1), to.p2 = static_cast<To>(p2);
    to.s1 = static_cast<To>(s1), to.s2 = static_cast<To>(s2);
    to.limit = static_cast<To>(limit < T{1e30} ? limit : T{1e30});
    return to;
  }
};

// Maps camera coordinates to pixels. (0, 0) is the centre of the top-left pixel.
//
// Lens distortion (Distortion, COLMAP's models.h, OpenCV's calib3d) of a point (X, Y, Z) gives (a', b'), and the pixel
// is (fx a' + cx, fy b' + cy). At some radius, the radial part g sqrt(q) may stop growing, so that rays beyond it would
// fold back into the image. Rays beyond this radius count as outside. Points with Z <= 0 count as outside as well,
// unless the lens is a fisheye lens: its field ends kFisheyeFieldDegrees from the axis. Pixels beyond the field have no
// ray.
class Lens {
 public:
  static constexpr int kMaxParams = 12;
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
  // The first terms of distortion(). They are the only terms of the models up to OPENCV.
  double k1() const { return distortion_.k[0]; }
  double k2() const { return distortion_.k[1]; }
  double p1() const { return distortion_.p1; }
  double p2() const { return distortion_.p2; }
  const Distortion<double>& distortion() const { return distortion_; }
  bool has_distortion() const { return has_distortion_; }
  Lens shifted(const Vec2& pixels) const;
  // Returns the length of (a, b) beyond which rays count as outside, because they would fold back into the image or
  // because the field of a fisheye lens ends. The length is infinite if rays never fold back.
  double max_length() const { return max_length_; }
  // Returns true if rays fold back before the end of the field of view.
  bool folds() const { return folds_; }

  // Bounds of the derivatives of the distorted coordinates (a', b') by (a, b), in any direction.
  struct Steepness {
    double least = 1, first = 1, second = 0, third = 0;  // `least`: smallest first derivative of the radial part
    double rounding = 1;  // by how much cancellation of terms increases the relative rounding error of g
  };
  // Measures the bounds at samples of the field that a distorted radius covers, with a margin.
  Steepness steepness(double distorted_radius) const;

  // Maps (a, b) to distorted normalised coordinates, without a test of max_length().
  Vec2 bend(const Vec2& ab) const;
  // Maps undistorted to distorted normalised coordinates. Returns nothing beyond max_length().
  std::optional<Vec2> distort(const Vec2& undistorted) const;
  // Does the inverse of distort(), accurate to 1e-12 focal lengths. Returns nothing if no ray with Z > 0 falls on this
  // position, or if the ray is beyond kMaxSlope. Adds the number of iterations to *steps, unless null. There are at
  // most kMaxRadialSteps + kMaxNewtonSteps.
  std::optional<Vec2> undistort(const Vec2& distorted, int* steps = nullptr) const;
  // Returns how long unproject() takes for an average pixel of an image: the mean number of iterations, measured at 64
  // pixels. It is 0 for a pinhole.
  double mean_iterations(int width, int height) const;

  // Maps camera coordinates to a pixel position, which may be outside the image. Returns nothing beyond the field.
  std::optional<Vec2> project(const Vec3& x_camera) const;
  // Returns the undistorted normalised coordinates (u, v) of a pixel position. The line of sight is (u, v, 1). Returns
  // nothing for pixels of a fisheye lens at 90 degrees from the axis and beyond; see direction().
  std::optional<Vec2> unproject(const Vec2& pixel) const;
  static constexpr double kMaxSlope = 1e6;  // largest length of (u, v) for a fisheye lens; 1e-6 radians from 90 degrees
  // Returns the line of sight of a pixel position in camera coordinates, in the whole field of the lens. Its length
  // is 1.
  std::optional<Vec3> direction(const Vec2& pixel) const;

 private:
  void read_distortion();
  // Returns the length of (a, b) where the radial part is `target`, or infinity if there is no such length.
  double solve_radial(double target, int* steps) const;
  // The inverse of bend().
  std::optional<Vec2> unbend(const Vec2& distorted, int* steps) const;

  LensModel model_;
  std::array<double, kMaxParams> params_{};
  double fx_, fy_, cx_, cy_;
  Distortion<double> distortion_;
  bool has_distortion_;
  double max_length_;
  bool folds_;
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
