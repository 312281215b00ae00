// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <array>
#include <optional>
#include <string>

#include "base/vec.h"

namespace lf {

// Levels and light. Pictures are encoded so: light is (level / 255) ^ kPictureGamma, and below kToe a straight line, so
// that noise in the dark stays what it is. Light below none is as much below zero.
inline constexpr double kPictureGamma = 2.2;
inline constexpr double kToe = 30;  // levels: light rises from none as steeply as in sRGB
double light_of(double level, double gamma = kPictureGamma);
double level_of(double light, double gamma = kPictureGamma);

// How one camera's colours differ from those that all cameras of its array are to have: the "colour" of a camera in a
// rig file. A camera that is as it should be has the default. With v a colour of the camera, 0..255 in each channel,
//
//   light = light_of(v - black, gamma)     of each channel
//   level = level_of(matrix * light) / (1 + k1 r^2 + k2 r^4) ^ (1 / kPictureGamma)
//
// with r = 1 half a diagonal of the image away from the lens's principal point: k1 and k2 say what share of the light
// the lens lets through.
struct ColourModel {
  Vec3 black{0, 0, 0};  // levels of 255 that the camera gives without any light
  double gamma = kPictureGamma;
  std::array<double, 9> matrix{1, 0, 0, 0, 1, 0, 0, 0, 1};  // row by row
  std::array<double, 2> vignetting{0, 0};                   // k1, k2
  bool operator==(const ColourModel&) const = default;

  static constexpr double kMostBlack = 64;                    // levels, either way
  static constexpr double kLeastGamma = 0.5, kMostGamma = 5;  // the exponents that cameras may be set to
  static constexpr double kMostEntry = 4;                     // largest entry of the matrix, either way
  // Shares of light that a lens may let through, of that in its middle.
  static constexpr double kLeastLight = 0.25, kMostLight = 2.5;
};

// Tells how far an image's pixels are from the lens's middle, as ColourModel::vignetting counts it.
class VignettingField {
 public:
  // `centre`: the principal point, pixels.
  VignettingField(int width, int height, const Vec2& centre);
  // r^2 at a pixel.
  double square(double x, double y) const;
  // The largest r^2 of a pixel of the image.
  double most() const { return most_; }

 private:
  Vec2 centre_;
  double scale_, most_;
};

// The share of the light that reaches the sensor where r^2 is that.
double light_share(const ColourModel& model, double r2);

// `level`: of the camera, 0..255; what it is to be without regard to vignetting, which may be outside of 0..255.
Vec3 corrected(const ColourModel& model, const Vec3& level);
// The factor of levels that makes up for a share of the light.
double level_factor(double light_share);

// What is wrong with a model for an image whose largest r^2 is `most_r2`: a member and a reason ("gamma: must be 0.5 to
// 5"); nothing: it is sound.
std::optional<std::string> fault_of(const ColourModel& model, double most_r2);

}  // namespace lf
