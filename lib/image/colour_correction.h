// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "base/maths.h"
#include "base/memory.h"
#include "image/image.h"

namespace lf {

// Conversion between levels and light: light is (level / 255) ^ gamma, but linear below kToe, so that noise in dark
// areas is not amplified. The functions are odd.
inline constexpr double kPictureGamma = 2.2;
inline constexpr double kToe = 30;  // levels; below, light rises linearly, as steeply as in sRGB
double decode_gamma(double level, double gamma = kPictureGamma);
double encode_gamma(double light, double gamma = kPictureGamma);

// Colour calibration of a camera: maps its colours to the common colours of the array. Stored as the "colour" of a
// camera in a rig file. The default changes nothing. With v a colour of the camera, 0..255 in each channel,
//
//   light = decode_gamma(v - black, gamma)     of each channel
//   level = encode_gamma(matrix * light) / (1 + k1 r^2 + k2 r^4) ^ (1 / kPictureGamma)
//
// where r is the distance to the principal point in half image diagonals. 1 + k1 r^2 + k2 r^4 is the light transmission
// of the lens.
struct ColourModel {
  Vec3 black{0, 0, 0};  // levels without light, of 255
  double gamma = kPictureGamma;
  std::array<double, 9> matrix{1, 0, 0, 0, 1, 0, 0, 0, 1};  // row by row
  std::array<double, 2> vignetting{0, 0};                   // k1, k2
  bool operator==(const ColourModel&) const = default;

  static constexpr double kMaxBlack = 64;                  // absolute value, levels
  static constexpr double kMinGamma = 0.5, kMaxGamma = 5;  // range of camera settings
  static constexpr double kMaxEntry = 4;                   // absolute value
  // Light transmission of a lens, relative to its centre.
  static constexpr double kMinLight = 0.25, kMaxLight = 2.5;
};

// Squared distances from the principal point, in the unit of ColourModel::vignetting.
class VignettingField {
 public:
  // `centre`: the principal point, pixels.
  VignettingField(int width, int height, const Vec2& centre);
  double square(double x, double y) const;
  double most() const { return most_; }

 private:
  Vec2 centre_;
  double scale_, most_;
};

// Returns the fraction of light that reaches the sensor at `r2`.
double vignetting_factor(const ColourModel& model, double r2);

// Corrects a camera's level (0..255) except for vignetting. The result may be outside of 0..255.
Vec3 corrected(const ColourModel& model, const Vec3& level);
double level_factor(double vignetting_factor);

// Returns the problem of a model for an image with a largest r^2 of `most_r2`, as a member and a reason ("gamma: must
// be 0.5 to 5"); nothing if the model is valid.
std::optional<std::string> model_error(const ColourModel& model, double most_r2);

// The ColorChecker chart: 24 patches in six columns and four rows on black. Units as in OpenCV's mcc module, with
// patches 2.5 wide. x right and y down, from the outer corner of the black border at the first patch.
namespace checker {

inline constexpr int kColumns = 6, kRows = 4, kPatches = kColumns * kRows;
inline constexpr double kSide = 2.5, kGap = 0.25;
inline constexpr double kWidth = kColumns * (kSide + kGap) + kGap, kHeight = kRows * (kSide + kGap) + kGap;

inline Vec2 middle(int patch) {
  return {kGap + kSide / 2 + patch % kColumns * (kSide + kGap), kGap + kSide / 2 + patch / kColumns * (kSide + kGap)};
}

// sRGB values of the patches under D65 (manufacturer's means for charts made before November 2014).
inline constexpr int kSrgb[kPatches][3] = {
    {115, 82, 68},   {194, 150, 130}, {98, 122, 157},  {87, 108, 67},   {133, 128, 177}, {103, 189, 170},
    {214, 126, 44},  {80, 91, 166},   {193, 90, 99},   {94, 60, 108},   {157, 188, 64},  {224, 163, 46},
    {56, 61, 150},   {70, 148, 73},   {175, 54, 60},   {231, 199, 31},  {187, 86, 149},  {8, 133, 161},
    {243, 243, 242}, {200, 200, 200}, {160, 160, 160}, {122, 122, 121}, {85, 85, 85},    {52, 52, 52}};

}  // namespace checker

// A ColourModel prepared for one camera's images of one family. Immutable.
//
// The model is split into an affine function, applied to each pixel, and a residual. The residual is read without
// interpolation from a table of 32 x 32 x 32 colours, in I420 once for 2 x 2 pixels. The vignetting factor is
// interpolated between rows. 16-bit arithmetic, bit-identical for all instruction sets. The mean error against double
// precision is 0.3 levels, including 0.25 of rounding. 1 % of the most saturated and dark colours differ by more than 1
// level, at most by 6.
class ColourCorrection {
 public:
  // `centre`: principal point, pixels. `family`: not kNone. `model`: valid.
  ColourCorrection(const ColourModel& model, PixelFamily family, int width, int height, const Vec2& centre);

  bool is_identity() const { return is_identity_; }
  // Corrects `rect` (inside the image; x0, y0 even for kI420) of an image of this family and size. The result is in
  // `memory`, with the same size and layout; pixels outside of `rect` are not written. Valid as long as `memory` is
  // unchanged.
  ImageView apply(const ImageView& image, const Rect& rect, ByteBuffer& memory) const;

  // Fixed-point numbers of the inner loops. Channels are R, G, B or Y, Cb, Cr without the 128 offset.
  static constexpr int kFactorRowStep = 8;  // plane rows per row of the factor table
  struct Tables {
    int16_t matrix[3][3];         // 13 fraction bits
    int16_t offset[3];            // 5 fraction bits
    std::vector<uint32_t> rest;   // 10 bits per channel from the highest, quarters of a level; empty: all 0
    std::vector<int16_t> factor;  // 14 fraction bits; columns x rows, of the chroma planes for kI420
    int factor_columns = 0;
  };

 private:
  void fit(const ColourModel& model);
  void tabulate_factor(const ColourModel& model, int width, int height, const Vec2& centre);

  PixelFamily family_;
  Tables tables_;
  bool is_identity_ = false;
};

// Returns the whole image corrected; `centre`: principal point.
Image corrected(const Image& image, const ColourModel& model, const Vec2& centre);

}  // namespace lf
