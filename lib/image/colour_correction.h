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

// The classic chart of 24 patches in six columns and four rows (ColorChecker): squares on black, in the measures of
// OpenCV's mcc module, in which a patch has a side of 2.5. x to the right and y down as the chart is read, from the
// outer corner of its black border beside the first patch.
namespace checker {

inline constexpr int kColumns = 6, kRows = 4, kPatches = kColumns * kRows;
inline constexpr double kSide = 2.5, kGap = 0.25;
inline constexpr double kWidth = kColumns * (kSide + kGap) + kGap, kHeight = kRows * (kSide + kGap) + kGap;

// The middle of patch 0 to 23, row by row.
inline Vec2 middle(int patch) {
  return {kGap + kSide / 2 + patch % kColumns * (kSide + kGap), kGap + kSide / 2 + patch / kColumns * (kSide + kGap)};
}

// What the patches are like in sRGB under D65 (means of charts of before November 2014, as their maker has them).
inline constexpr int kSrgb[kPatches][3] = {
    {115, 82, 68},   {194, 150, 130}, {98, 122, 157},  {87, 108, 67},   {133, 128, 177}, {103, 189, 170},
    {214, 126, 44},  {80, 91, 166},   {193, 90, 99},   {94, 60, 108},   {157, 188, 64},  {224, 163, 46},
    {56, 61, 150},   {70, 148, 73},   {175, 54, 60},   {231, 199, 31},  {187, 86, 149},  {8, 133, 161},
    {243, 243, 242}, {200, 200, 200}, {160, 160, 160}, {122, 122, 121}, {85, 85, 85},    {52, 52, 52}};

}  // namespace checker

// A ColourModel made ready for one camera's images of one family. Immutable.
//
// What the model does to a colour is close to an affine function of it, which is applied to each pixel; what is left of
// it is read from a table of 32 x 32 x 32 colours, without interpolation, in I420 for 2 x 2 pixels together; and what
// the lens loses is a factor, interpolated between rows. 16-bit arithmetic, the same result with every instruction set.
// Against the model in double precision levels are off by 0.3 in the mean, of which 0.25 is rounding; 1 % of the most
// saturated and dark ones are off by more than 1, by 6 at most.
class ColourCorrection {
 public:
  // `centre`: the lens's principal point, pixels. `family`: not kNone. The model has no fault.
  ColourCorrection(const ColourModel& model, PixelFamily family, int width, int height, const Vec2& centre);

  // Whether the correction leaves every level as it is.
  bool is_identity() const { return is_identity_; }
  // The image, of the family and size that this is for, with its part in `rect` (inside it; x0, y0 even in kI420)
  // corrected, in `memory`, of which the rest is left as it is: of the same size and layout. Valid as long as `memory`
  // is left alone.
  ImageView apply(const ImageView& image, const Rect& rect, ByteBuffer& memory) const;

  // Fixed-point numbers, for the loops. Channels are R, G, B or Y, Cb, Cr without the 128 offset.
  static constexpr int kRowsApart = 8;  // rows of the table of factors, in rows of its plane
  struct Tables {
    int16_t matrix[3][3];         // 13 bits of fraction
    int16_t offset[3];            // 5 bits
    std::vector<uint32_t> rest;   // ten bits a channel from the highest, quarters of a level; empty: all 0
    std::vector<int16_t> factor;  // 14 bits; columns x rows; chroma's columns and rows in kI420
    int factor_columns = 0;
  };

 private:
  void fit(const ColourModel& model);
  void tabulate_factor(const ColourModel& model, int width, int height, const Vec2& centre);

  PixelFamily family_;
  Tables tables_;
  bool is_identity_ = false;
};

// The whole image, corrected; `centre`: the principal point of the camera's lens.
Image corrected(const Image& image, const ColourModel& model, const Vec2& centre);

}  // namespace lf
