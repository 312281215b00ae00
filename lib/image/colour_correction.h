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

// Convert between levels (0..255) and light. Light is (level / 255) ^ gamma, but linear below kToe, so that noise in
// dark areas is not amplified. The functions are odd.
inline constexpr double kPictureGamma = 2.2;
inline constexpr double kToe = 30;  // in levels; below this, light rises linearly, as steeply as in sRGB
double decode_gamma(double level, double gamma = kPictureGamma);
double encode_gamma(double light, double gamma = kPictureGamma);

// The colour calibration of a camera, which maps its colours to the common colours of the array. Rig files store it as
// the "colour" of a camera. The default changes nothing. With v a colour of the camera, 0..255 in each channel,
//
//   light = decode_gamma(v - black, gamma)     of each channel
//   level = encode_gamma(matrix * light) / (1 + k1 r^2 + k2 r^4) ^ (1 / kPictureGamma)
//
// where r is the distance from the principal point in half image diagonals. 1 + k1 r^2 + k2 r^4 is the fraction of
// light that the lens transmits there.
struct ColourModel {
  Vec3 black{0, 0, 0};  // levels without light, of 255
  double gamma = kPictureGamma;
  std::array<double, 9> matrix{1, 0, 0, 0, 1, 0, 0, 0, 1};  // row by row
  std::array<double, 2> vignetting{0, 0};                   // k1, k2
  bool operator==(const ColourModel&) const = default;

  static constexpr double kMaxBlack = 64;                  // absolute value, levels
  static constexpr double kMinGamma = 0.5, kMaxGamma = 5;  // range of camera settings
  static constexpr double kMaxEntry = 4;                   // absolute value
  static constexpr double kMinLight = 0.25, kMaxLight = 2.5;
};

// Computes squared distances from the principal point, in the unit of ColourModel::vignetting.
class VignettingField {
 public:
  // `centre` is the principal point in pixels.
  VignettingField(int width, int height, const Vec2& centre);
  double square(double x, double y) const;
  double most() const { return most_; }

 private:
  Vec2 centre_;
  double scale_, most_;
};

// Returns the fraction of light that reaches the sensor at the squared distance `r2`.
double vignetting_factor(const ColourModel& model, double r2);

// Corrects a camera's level (0..255) except for vignetting. The result may be outside 0..255.
Vec3 corrected(const ColourModel& model, const Vec3& level);
double level_factor(double vignetting_factor);

// Returns the problem of a model as a member and a reason, for example "gamma: must be 0.5 to 5", or nothing if the
// model is valid. `most_r2` is the largest r^2 in the image.
std::optional<std::string> model_error(const ColourModel& model, double most_r2);

// The ColorChecker chart: 24 patches in six columns and four rows on black. Patches are 2.5 wide, as in OpenCV's mcc
// module. x is to the right and y down, from the outer corner of the black border at the first patch.
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

// Applies a ColourModel to the images of one camera, all of one family. Immutable.
//
// For speed, the model is approximated by an affine function of the colour, plus a residual from a table of 32 x 32 x
// 32 colours. In I420, each 2 x 2 pixels share a residual. All instruction sets give the same bits. The mean error
// against double precision is 0.3 levels, including 0.25 of rounding. 1 % of the most saturated and dark colours differ
// by more than 1 level, at most by 6.
class ColourCorrection {
 public:
  // `centre` is the principal point in pixels. `family` must not be kNone, and `model` must be valid.
  ColourCorrection(const ColourModel& model, PixelFamily family, int width, int height, const Vec2& centre);

  bool is_identity() const { return is_identity_; }
  // Corrects `rect` of an image of this family and size. `rect` must be inside the image, with even x0 and y0 for
  // kI420. The result is in `memory`, with the same size and layout, and is valid until `memory` changes. Pixels
  // outside `rect` are not written.
  ImageView apply(const ImageView& image, const Rect& rect, ByteBuffer& memory) const;

  // Fixed-point numbers for the inner loops. The channels are R, G, B or Y, Cb, Cr without the 128 offset.
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

// Returns the whole image corrected. `centre` is the principal point.
Image corrected(const Image& image, const ColourModel& model, const Vec2& centre);

}  // namespace lf
