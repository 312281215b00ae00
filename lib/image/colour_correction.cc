// SPDX-License-Identifier: LGPL-2.1-or-later
#include "image/colour_correction.h"

#include <algorithm>
#include <cmath>

#include "image/colour_rows.h"
#include "image/correction.h"

namespace lf {
namespace {

// Between RGB and the family's channels, Y, Cb, Cr of full-range BT.601 without the 128 offset.
Vec3 to_channels(PixelFamily family, const Vec3& rgb) {
  if (family == PixelFamily::kRgb) return rgb;
  const double y = 0.299 * rgb.x + 0.587 * rgb.y + 0.114 * rgb.z;
  return {y, (rgb.z - y) / 1.772, (rgb.x - y) / 1.402};
}

Vec3 to_rgb(PixelFamily family, const Vec3& channels) {
  if (family == PixelFamily::kRgb) return channels;
  const auto& [y, cb, cr] = std::array<double, 3>{channels.x, channels.y, channels.z};
  return {y + 1.402 * cr, y - 0.114 * 1.772 / 0.587 * cb - 0.299 * 1.402 / 0.587 * cr, y + 1.772 * cb};
}

// What a model makes of the channels of a family, with its powers read from tables: to a thousandth of a level.
class Model {
 public:
  Model(const ColourModel& model, PixelFamily family) : model_(model), family_(family) {
    for (int i = 0; i <= kSteps; i++) {
      light_.push_back(light_of(kMostLevel * i / kSteps, model.gamma));
      const double root = kMostRoot * i / kSteps;
      level_.push_back(level_of(root * root));
    }
  }
  Vec3 operator()(const Vec3& channels) const {
    const Vec3 rgb = to_rgb(family_, channels);
    double light[3];
    for (int c = 0; c < 3; c++) light[c] = read(light_, (rgb[c] - model_.black[c]) / kMostLevel);
    Vec3 out;
    for (int c = 0; c < 3; c++) {
      const double* const row = &model_.matrix[static_cast<size_t>(3 * c)];
      const double sum = row[0] * light[0] + row[1] * light[1] + row[2] * light[2];
      // Light is the square of what the table goes by: levels are steep near none.
      out[c] = read(level_, std::copysign(std::sqrt(std::abs(sum)), sum) / kMostRoot);
    }
    return to_channels(family_, out);
  }

 private:
  static constexpr int kSteps = 4096;
  // Corners of YCbCr's cube are colours far outside of RGB's.
  static constexpr double kMostLevel = 640, kMostRoot = 16;

  // At `place` of 0 to 1, or as much below zero.
  static double read(const std::vector<double>& table, double place) {
    const double at = std::min(std::abs(place), 1.0) * kSteps;
    const auto i = std::min<size_t>(static_cast<size_t>(at), kSteps - 1);
    return std::copysign(table[i] + (at - static_cast<double>(i)) * (table[i + 1] - table[i]), place);
  }

  const ColourModel& model_;
  PixelFamily family_;
  std::vector<double> light_, level_;
};

// The affine function nearest to the model over colours that there are: a + b x + c y + d z for each channel.
struct Affine {
  double of[3][4];
  Vec3 operator()(const Vec3& v) const {
    Vec3 out;
    for (int k = 0; k < 3; k++) out[k] = of[k][0] * v.x + of[k][1] * v.y + of[k][2] * v.z + of[k][3];
    return out;
  }
};

// Solves the 4 x 4 system of normal equations for three right sides at once.
void solve(double (&a)[4][7]) {
  for (int i = 0; i < 4; i++) {
    int best = i;
    for (int r = i + 1; r < 4; r++)
      if (std::abs(a[r][i]) > std::abs(a[best][i])) best = r;
    std::swap(a[i], a[best]);
    for (int r = 0; r < 4; r++) {
      if (r == i) continue;
      const double f = a[r][i] / a[i][i];
      for (int c = i; c < 7; c++) a[r][c] -= f * a[i][c];
    }
  }
  for (int i = 0; i < 4; i++)
    for (int c = 4; c < 7; c++) a[i][c] /= a[i][i];
}

Affine fit_affine(const Model& model, PixelFamily family) {
  constexpr int kSteps = 8;
  double a[4][7] = {};
  for (int r = 0; r <= kSteps; r++)
    for (int g = 0; g <= kSteps; g++)
      for (int b = 0; b <= kSteps; b++) {
        const Vec3 in = to_channels(family, Vec3(r, g, b) * (255.0 / kSteps)), out = model(in);
        const double x[4] = {in.x, in.y, in.z, 1};
        for (int i = 0; i < 4; i++) {
          for (int j = 0; j < 4; j++) a[i][j] += x[i] * x[j];
          for (int k = 0; k < 3; k++) a[i][4 + k] += x[i] * out[k];
        }
      }
  solve(a);
  Affine affine;
  for (int k = 0; k < 3; k++)
    for (int i = 0; i < 4; i++) affine.of[k][i] = a[i][4 + k];
  return affine;
}

int16_t fixed(double value, int bits) {
  return static_cast<int16_t>(std::clamp<long>(std::lround(std::ldexp(value, bits)), -32768, 32767));
}

constexpr double kMostSlope = 1.99;  // times the lens's factor, below 2, 13 bits of fraction hold it
constexpr double kLeastRest = 0.25;  // levels: what is nearer to the affine function is that

}  // namespace

ColourCorrection::ColourCorrection(const ColourModel& model, PixelFamily family, int width, int height,
                                   const Vec2& centre)
    : family_(family), is_identity_(model == ColourModel()) {
  if (is_identity_) return;
  fit(model);
  tabulate_factor(model, width, height, centre);
}

void ColourCorrection::fit(const ColourModel& model) {
  const Model exact(model, family_);
  const Affine affine = fit_affine(exact, family_);
  for (int k = 0; k < 3; k++) {
    for (int i = 0; i < 3; i++) tables_.matrix[k][i] = fixed(std::clamp(affine.of[k][i], -kMostSlope, kMostSlope), 13);
    tables_.offset[k] = fixed(affine.of[k][3], 5);
  }
  const Vec3 none = family_ == PixelFamily::kRgb ? Vec3(0) : Vec3(0, 128, 128);
  double most = 0;
  tables_.rest.reserve(size_t{32} * 32 * 32);
  for (int i = 0; i < 32; i++)
    for (int j = 0; j < 32; j++)
      for (int k = 0; k < 32; k++) {
        const Vec3 in = Vec3(i, j, k) * 8.0 + 3.5 - none, rest = exact(in) - affine(in);
        uint32_t packed = 0;
        for (int c = 0; c < 3; c++) {
          const long quarters = std::clamp<long>(std::lround(4 * rest[c]), -512, 511);
          packed |= (static_cast<uint32_t>(quarters) & 0x3ff) << (22 - 10 * c);
        }
        tables_.rest.push_back(packed);
        const Vec3 colour = to_rgb(family_, in);
        if (std::min({colour.x, colour.y, colour.z}) >= 0 && std::max({colour.x, colour.y, colour.z}) <= 255)
          most = std::max({most, std::abs(rest.x), std::abs(rest.y), std::abs(rest.z)});
      }
  if (most < kLeastRest) tables_.rest.clear();
}

void ColourCorrection::tabulate_factor(const ColourModel& model, int width, int height, const Vec2& centre) {
  const VignettingField field(width, height, centre);
  // 1024 steps of r^2 in place of a power for each sample.
  constexpr int kSteps = 1024;
  std::vector<double> of_square;
  for (int i = 0; i <= kSteps; i++) of_square.push_back(level_factor(light_share(model, field.most() * i / kSteps)));
  const auto factor = [&](double x, double y) {
    const double at = std::clamp(field.square(x, y) / field.most(), 0.0, 1.0) * kSteps;
    const int i = std::min(static_cast<int>(at), kSteps - 1);
    return of_square[i] + (at - i) * (of_square[i + 1] - of_square[i]);
  };
  const bool rgb = family_ == PixelFamily::kRgb;
  const int columns = rgb ? width : chroma_size(width), rows = rgb ? height : chroma_size(height);
  const double step = rgb ? 1 : 2, first = rgb ? 0 : 0.5;
  tables_.factor_columns = columns;
  for (int row = 0; row < rows + kRowsApart; row += kRowsApart)
    for (int x = 0; x < columns; x++) tables_.factor.push_back(fixed(factor(step * x + first, step * row + first), 14));
}

ImageView ColourCorrection::apply(const ImageView& image, const Rect& rect, ByteBuffer& memory) const {
  PlaneCopy planes[3];
  const ImageView out = write_copy(image, rect, memory, [&](const PlaneCopy& plane) { planes[plane.index] = plane; });
  if (family_ == PixelFamily::kRgb)
    correct_rgb(tables_, planes[0], image.layout);
  else
    correct_i420(tables_, planes[0], planes[1], planes[2]);
  return out;
}

Image corrected(const Image& image, const ColourModel& model, const Vec2& centre) {
  const ColourCorrection correction(model, image.family(), image.width(), image.height(), centre);
  if (correction.is_identity()) return image;
  ByteBuffer memory;
  correction.apply(image.view(), {0, 0, image.width(), image.height()}, memory);
  Image out(image.family(), image.width(), image.height());
  std::ranges::copy(memory, out.data().begin());
  return out;
}

}  // namespace lf
