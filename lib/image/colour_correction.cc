// SPDX-License-Identifier: LGPL-2.1-or-later
#include "image/colour_correction.h"

#include <algorithm>
#include <cmath>
#include <cstring>

#include "base/text.h"
#include "image/image_filters.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "image/colour_correction.cc"
#include <hwy/foreach_target.h>  // must precede highway.h
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace lf::HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

using Tables = ColourCorrection::Tables;
using D = hn::ScalableTag<int16_t>;
using V = hn::Vec<D>;
using D8 = hn::Rebind<uint8_t, D>;
inline constexpr D d;
inline constexpr int kMaxLanes = 64;  // upper bound for all instruction sets

HWY_INLINE V set(int value) { return hn::Set(d, static_cast<int16_t>(value)); }
// Fixed-point product with 15 fraction bits fewer than both factors together.
HWY_INLINE V times(V a, V b) { return hn::MulFixedPoint15(a, b); }
HWY_INLINE V plus(V a, V b) { return hn::SaturatedAdd(a, b); }

struct Triple {
  V of[3];
};

// Pixels at even and odd positions of a row, 7 fraction bits.
struct Pairs {
  V even, odd;
};

#if HWY_TARGET != HWY_SCALAR
HWY_INLINE Pairs load_pairs(const uint8_t* from) {
  const hn::RebindToUnsigned<D> du;
  const auto both = hn::BitCast(du, hn::LoadU(hn::Repartition<uint8_t, D>(), from));
  return {hn::BitCast(d, hn::ShiftLeft<7>(hn::And(both, hn::Set(du, 0x00ff)))),
          hn::BitCast(d, hn::ShiftRight<1>(hn::And(both, hn::Set(du, 0xff00))))};
}

HWY_INLINE void store_pairs(const Pairs& level, uint8_t* to) {
  const hn::Repartition<uint8_t, D> d8x2;
  hn::StoreU(hn::BitCast(d8x2, hn::Or(level.even, hn::ShiftLeft<8>(level.odd))), d8x2, to);
}

// Looks up residuals with 5 fraction bits.
HWY_INLINE Triple rest_at(const uint32_t* table, V index) {
  const hn::Repartition<int32_t, D> d32;
  const auto* const from = reinterpret_cast<const int32_t*>(table);
  const auto pairs = hn::BitCast(d32, index);
  const auto even = hn::GatherIndex(d32, from, hn::And(pairs, hn::Set(d32, 0xffff)));
  const auto odd = hn::GatherIndex(d32, from, hn::ShiftRight<16>(pairs));
  // Expands 10-bit values to 16 bits, for even and odd lanes.
  const auto join = [&](auto e, auto o) HWY_ATTR {
    return hn::BitCast(d, hn::Or(hn::And(hn::ShiftRight<19>(e), hn::Set(d32, 0x0000fff8)),
                                 hn::And(hn::ShiftRight<3>(o), hn::Set(d32, static_cast<int32_t>(0xfff80000u)))));
  };
  return {{join(even, odd), join(hn::ShiftLeft<10>(even), hn::ShiftLeft<10>(odd)),
           join(hn::ShiftLeft<20>(even), hn::ShiftLeft<20>(odd))}};
}
#else
HWY_INLINE Pairs load_pairs(const uint8_t* from) { return {set(from[0] << 7), set(from[1] << 7)}; }

HWY_INLINE void store_pairs(const Pairs& level, uint8_t* to) {
  to[0] = static_cast<uint8_t>(hn::GetLane(level.even));
  to[1] = static_cast<uint8_t>(hn::GetLane(level.odd));
}

HWY_INLINE Triple rest_at(const uint32_t* table, V index) {
  const uint32_t packed = table[hn::GetLane(index)];
  const auto bits = [packed](int place) { return set((static_cast<int32_t>(packed << place) >> 22) * 8); };
  return {{bits(0), bits(10), bits(20)}};
}
#endif

HWY_INLINE V table_index(V a, V b, V c) {
  const V high = set(0xf8);
  return hn::Or(hn::ShiftLeft<7>(hn::And(a, high)), hn::Or(hn::ShiftLeft<2>(hn::And(b, high)), hn::ShiftRight<3>(c)));
}

HWY_INLINE V mean_of(V a, V b) {
  const hn::RebindToUnsigned<D> du;
  return hn::BitCast(d, hn::AverageRound(hn::BitCast(du, a), hn::BitCast(du, b)));
}

struct Row {
  const int16_t *above, *below;
  int16_t between;  // weight of `below`, 15 fraction bits

  Row(const Tables& tables, int y, int x0) {
    constexpr int kApart = ColourCorrection::kFactorRowStep;
    above = tables.factor.data() + static_cast<ptrdiff_t>(y / kApart) * tables.factor_columns + x0;
    below = above + tables.factor_columns;
    between = static_cast<int16_t>(y % kApart * (32768 / kApart));
  }
  HWY_INLINE V at(int i) const {
    const V a = hn::LoadU(d, above + i);
    return hn::Add(a, times(hn::Sub(hn::LoadU(d, below + i), a), set(between)));
  }
};

struct Quads {
  const uint8_t *upper, *lower, *cb, *cr;
  uint8_t *out_upper, *out_lower, *out_cb, *out_cr;
};

// Levels have 7 fraction bits, sums 5, and sums times the vignetting factor 4, so 16 bits have room for twice 255 and
// for negative values.
template <bool kHasRest>
HWY_INLINE void quads(const Tables& t, const Quads& at, V factor) {
  const D8 d8;
  const Pairs upper = load_pairs(at.upper), lower = load_pairs(at.lower);
  const V y = mean_of(mean_of(upper.even, upper.odd), mean_of(lower.even, lower.odd));
  const V cb_byte = hn::PromoteTo(d, hn::LoadU(d8, at.cb)), cr_byte = hn::PromoteTo(d, hn::LoadU(d8, at.cr));
  const V cb = hn::ShiftLeft<7>(hn::Sub(cb_byte, set(128))), cr = hn::ShiftLeft<7>(hn::Sub(cr_byte, set(128)));

  Triple sum{{set(t.offset[0]), set(t.offset[1]), set(t.offset[2])}};
  if constexpr (kHasRest) {
    const V index = table_index(hn::ShiftRight<7>(y), cb_byte, cr_byte);
    const Triple rest = rest_at(t.rest.data(), index);
    for (int k = 0; k < 3; k++) sum.of[k] = hn::Add(sum.of[k], rest.of[k]);
  }
  for (int k = 0; k < 3; k++) {
    sum.of[k] = plus(sum.of[k], plus(times(cb, set(t.matrix[k][1])), times(cr, set(t.matrix[k][2]))));
    if (k > 0) sum.of[k] = plus(sum.of[k], times(y, set(t.matrix[k][0])));
    sum.of[k] = times(sum.of[k], factor);
  }
  const auto put_chroma = [&](V value, uint8_t* to) HWY_ATTR {
    hn::StoreU(hn::DemoteTo(d8, hn::ShiftRight<4>(hn::Add(value, set((128 << 4) + 8)))), d8, to);
  };
  put_chroma(sum.of[1], at.out_cb);
  put_chroma(sum.of[2], at.out_cr);

  const V slope = hn::ShiftLeft<1>(times(set(t.matrix[0][0]), factor));
  const V more = hn::Add(hn::ShiftLeft<1>(sum.of[0]), set(16));
  const auto level = [&](V pixel) HWY_ATTR {
    const V value = hn::ShiftRight<5>(plus(times(pixel, slope), more));
    return hn::Min(hn::Max(value, hn::Zero(d)), set(255));
  };
  store_pairs({level(upper.even), level(upper.odd)}, at.out_upper);
  store_pairs({level(lower.even), level(lower.odd)}, at.out_lower);
}

template <bool kHasRest>
HWY_INLINE void quad_row(const Tables& t, const Quads& row, const Row& factors, int n, bool half_last) {
  const int lanes = static_cast<int>(hn::Lanes(d));
  const auto at = [&](int i) {
    return Quads{row.upper + 2 * i,     row.lower + 2 * i,     row.cb + i,     row.cr + i,
                 row.out_upper + 2 * i, row.out_lower + 2 * i, row.out_cb + i, row.out_cr + i};
  };
  int i = 0;
  const int whole = n - (half_last ? 1 : 0);
  for (; i + lanes <= whole; i += lanes) quads<kHasRest>(t, at(i), factors.at(i));
  if (i == n) return;
  if (!half_last && n >= lanes) {  // overlaps the previous vector
    quads<kHasRest>(t, at(n - lanes), factors.at(n - lanes));
    return;
  }
  // Process the rest of a short row, or of a row that ends with half a pair.
  alignas(64) uint8_t in[4][2 * kMaxLanes] = {}, out[4][2 * kMaxLanes];
  alignas(64) int16_t factor[kMaxLanes] = {};
  const int left = n - i, luma = 2 * left - (half_last ? 1 : 0);
  const Quads from = at(i);
  std::memcpy(in[0], from.upper, static_cast<size_t>(luma));
  std::memcpy(in[1], from.lower, static_cast<size_t>(luma));
  std::memcpy(in[2], from.cb, static_cast<size_t>(left));
  std::memcpy(in[3], from.cr, static_cast<size_t>(left));
  if (half_last)
    for (int r = 0; r < 2; r++) in[r][luma] = in[r][luma - 1];
  for (int k = 0; k < left; k++)
    factor[k] = static_cast<int16_t>(
        factors.above[i + k] + (((factors.below[i + k] - factors.above[i + k]) * factors.between + (1 << 14)) >> 15));
  quads<kHasRest>(t, {in[0], in[1], in[2], in[3], out[0], out[1], out[2], out[3]}, hn::Load(d, factor));
  std::memcpy(from.out_upper, out[0], static_cast<size_t>(luma));
  std::memcpy(from.out_lower, out[1], static_cast<size_t>(luma));
  std::memcpy(from.out_cb, out[2], static_cast<size_t>(left));
  std::memcpy(from.out_cr, out[3], static_cast<size_t>(left));
}

template <bool kHasRest>
void i420_rows(const Tables& t, const PlaneCopy& y, const PlaneCopy& cb, const PlaneCopy& cr) {
  const Rect& part = cb.part;
  // If the image width is odd, the last chroma column belongs to a single luma column.
  const bool half_last = 2 * part.x1 > y.width;
  for (int row = part.y0; row < part.y1; row++) {
    const ptrdiff_t upper = 2 * row * y.stride + 2 * part.x0;
    const ptrdiff_t lower = std::min(2 * row + 1, y.height - 1) * y.stride + 2 * part.x0;
    const ptrdiff_t b = row * cb.stride + part.x0, r = row * cr.stride + part.x0;
    quad_row<kHasRest>(
        t, {y.from + upper, y.from + lower, cb.from + b, cr.from + r, y.to + upper, y.to + lower, cb.to + b, cr.to + r},
        Row(t, row, part.x0), part.width(), half_last);
  }
}

void i420(const Tables& t, const PlaneCopy& y, const PlaneCopy& cb, const PlaneCopy& cr) {
  t.rest.empty() ? i420_rows<false>(t, y, cb, cr) : i420_rows<true>(t, y, cb, cr);
}

template <int kStride>
HWY_INLINE void pixels(const Tables& t, const RgbLayout& layout, const uint8_t* from, uint8_t* to, V factor) {
  const D8 d8;
  hn::Vec<D8> byte[4];
  if constexpr (kStride == 3)
    hn::LoadInterleaved3(d8, from, byte[0], byte[1], byte[2]);
  else
    hn::LoadInterleaved4(d8, from, byte[0], byte[1], byte[2], byte[3]);
  const V r = hn::PromoteTo(d, byte[layout.r]), g = hn::PromoteTo(d, byte[layout.g]),
          b = hn::PromoteTo(d, byte[layout.b]);
  const V in[3] = {hn::ShiftLeft<7>(r), hn::ShiftLeft<7>(g), hn::ShiftLeft<7>(b)};
  Triple sum{{set(t.offset[0]), set(t.offset[1]), set(t.offset[2])}};
  if (!t.rest.empty()) {
    const V index = table_index(r, g, b);
    const Triple rest = rest_at(t.rest.data(), index);
    for (int k = 0; k < 3; k++) sum.of[k] = hn::Add(sum.of[k], rest.of[k]);
  }
  const int place[3] = {layout.r, layout.g, layout.b};
  for (int k = 0; k < 3; k++) {
    for (int c = 0; c < 3; c++) sum.of[k] = plus(sum.of[k], times(in[c], set(t.matrix[k][c])));
    const V value = hn::Add(times(sum.of[k], factor), set(8));
    byte[place[k]] = hn::DemoteTo(d8, hn::ShiftRight<4>(value));
  }
  if constexpr (kStride == 3)
    hn::StoreInterleaved3(byte[0], byte[1], byte[2], d8, to);
  else
    hn::StoreInterleaved4(byte[0], byte[1], byte[2], byte[3], d8, to);
}

template <int kStride>
void rgb_rows(const Tables& t, const PlaneCopy& plane, const RgbLayout& layout) {
  const int lanes = static_cast<int>(hn::Lanes(d)), n = plane.part.width();
  for (int row = plane.part.y0; row < plane.part.y1; row++) {
    const Row factors(t, row, plane.part.x0);
    const ptrdiff_t begin = row * plane.stride + kStride * ptrdiff_t{plane.part.x0};
    const uint8_t* const from = plane.from + begin;
    uint8_t* const to = plane.to + begin;
    int i = 0;
    for (; i + lanes <= n; i += lanes) pixels<kStride>(t, layout, from + kStride * i, to + kStride * i, factors.at(i));
    if (i == n) continue;
    if (n >= lanes) {
      i = n - lanes;
      pixels<kStride>(t, layout, from + kStride * i, to + kStride * i, factors.at(i));
      continue;
    }
    alignas(64) uint8_t in[4 * kMaxLanes] = {}, out[4 * kMaxLanes];
    alignas(64) int16_t factor[kMaxLanes] = {};
    std::memcpy(in, from, static_cast<size_t>(kStride * n));
    for (int k = 0; k < n; k++)
      factor[k] = static_cast<int16_t>(factors.above[k] +
                                       (((factors.below[k] - factors.above[k]) * factors.between + (1 << 14)) >> 15));
    pixels<kStride>(t, layout, in, out, hn::Load(d, factor));
    std::memcpy(to, out, static_cast<size_t>(kStride * n));
  }
}

void rgb(const Tables& t, const PlaneCopy& plane, const RgbLayout& layout) {
  plane.step == 3 ? rgb_rows<3>(t, plane, layout) : rgb_rows<4>(t, plane, layout);
}

}  // namespace lf::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace lf {
namespace {

double determinant(const std::array<double, 9>& m) {
  return m[0] * (m[4] * m[8] - m[5] * m[7]) - m[1] * (m[3] * m[8] - m[5] * m[6]) + m[2] * (m[3] * m[7] - m[4] * m[6]);
}

// Convert between RGB and the channels of the family: Y, Cb, Cr of full-range BT.601 without the 128 offset.
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

// Applies a model to the channels of a family. Powers come from a table that is accurate to a thousandth of a level.
class Model {
 public:
  Model(const ColourModel& model, PixelFamily family) : model_(model), family_(family) {
    for (int i = 0; i <= kSteps; i++) {
      light_.push_back(decode_gamma(kMaxLevel * i / kSteps, model.gamma));
      const double root = kMaxRoot * i / kSteps;
      level_.push_back(encode_gamma(root * root));
    }
  }
  Vec3 operator()(const Vec3& channels) const {
    const Vec3 rgb = to_rgb(family_, channels);
    double light[3];
    for (int c = 0; c < 3; c++) light[c] = read(light_, (rgb[c] - model_.black[c]) / kMaxLevel);
    Vec3 out;
    for (int c = 0; c < 3; c++) {
      const double* const row = &model_.matrix[static_cast<size_t>(3 * c)];
      const double sum = row[0] * light[0] + row[1] * light[1] + row[2] * light[2];
      // The table is indexed by the square root of light, because levels are steep near 0.
      out[c] = read(level_, std::copysign(std::sqrt(std::abs(sum)), sum) / kMaxRoot);
    }
    return to_channels(family_, out);
  }

 private:
  static constexpr int kSteps = 4096;
  // Corners of the YCbCr cube are far outside of RGB.
  static constexpr double kMaxLevel = 640, kMaxRoot = 16;

  // `place` is -1 to 1; the function is odd.
  static double read(const std::vector<double>& table, double place) {
    const double at = std::min(std::abs(place), 1.0) * kSteps;
    const auto i = std::min<size_t>(static_cast<size_t>(at), kSteps - 1);
    return std::copysign(table[i] + (at - static_cast<double>(i)) * (table[i + 1] - table[i]), place);
  }

  const ColourModel& model_;
  PixelFamily family_;
  std::vector<double> light_, level_;
};

// Computes the least-squares affine approximation of the model over all valid colours: a + b x + c y + d z for each
// channel.
struct Affine {
  double of[3][4];
  Vec3 operator()(const Vec3& v) const {
    Vec3 out;
    for (int k = 0; k < 3; k++) out[k] = of[k][0] * v.x + of[k][1] * v.y + of[k][2] * v.z + of[k][3];
    return out;
  }
};

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

constexpr double kMaxSlope = 1.99;   // below 2, so that the slope times the vignetting factor fits 13 fraction bits
constexpr double kMinRest = 0.25;    // levels; smaller residuals are ignored

}  // namespace

HWY_EXPORT(i420);
HWY_EXPORT(rgb);

double decode_gamma(double level, double gamma) {
  const double v = std::abs(level);
  const double light = v >= kToe ? std::pow(v / 255, gamma) : v / kToe * std::pow(kToe / 255, gamma);
  return std::copysign(light, level);
}

double encode_gamma(double light, double gamma) {
  const double toe = std::pow(kToe / 255, gamma), v = std::abs(light);
  return std::copysign(v >= toe ? 255 * std::pow(v, 1 / gamma) : v / toe * kToe, light);
}

VignettingField::VignettingField(int width, int height, const Vec2& centre)
    : centre_(centre), scale_(4.0 / (static_cast<double>(width) * width + static_cast<double>(height) * height)) {
  most_ = std::max({square(0, 0), square(width - 1, 0), square(0, height - 1), square(width - 1, height - 1)});
}

double VignettingField::square(double x, double y) const {
  const double dx = x - centre_.x, dy = y - centre_.y;
  return scale_ * (dx * dx + dy * dy);
}

double vignetting_factor(const ColourModel& model, double r2) {
  return 1 + r2 * (model.vignetting[0] + r2 * model.vignetting[1]);
}

Vec3 corrected(const ColourModel& model, const Vec3& level) {
  double light[3];
  for (int c = 0; c < 3; c++) light[c] = decode_gamma(level[c] - model.black[c], model.gamma);
  Vec3 out;
  for (int c = 0; c < 3; c++) {
    const double* const row = &model.matrix[static_cast<size_t>(3 * c)];
    out[c] = encode_gamma(row[0] * light[0] + row[1] * light[1] + row[2] * light[2]);
  }
  return out;
}

double level_factor(double vignetting_factor) { return std::pow(vignetting_factor, -1 / kPictureGamma); }

std::optional<std::string> model_error(const ColourModel& model, double most_r2) {
  using M = ColourModel;
  const auto bounds = [](double least, double most) {
    return ": must be " + number_text(least) + " to " + number_text(most);
  };
  for (int c = 0; c < 3; c++)
    if (!(std::abs(model.black[c]) <= M::kMaxBlack))
      return "black[" + std::to_string(c) + "]" + bounds(-M::kMaxBlack, M::kMaxBlack);
  if (!(model.gamma >= M::kMinGamma && model.gamma <= M::kMaxGamma))
    return "gamma" + bounds(M::kMinGamma, M::kMaxGamma);
  for (size_t i = 0; i < model.matrix.size(); i++)
    if (!(std::abs(model.matrix[i]) <= M::kMaxEntry))
      return "matrix[" + std::to_string(i) + "]" + bounds(-M::kMaxEntry, M::kMaxEntry);
  if (!(determinant(model.matrix) >= 1e-4)) return "matrix: determinant must be at least 0.0001";
  // The transmission is a parabola in r^2, so its extremes are at the ends and at the vertex.
  double least = 1, most = 1;
  const auto look_at = [&](double r2) {
    const double share = vignetting_factor(model, r2);
    // The negated comparison also catches NaN.
    if (!(share >= least)) least = share;
    if (!(share <= most)) most = share;
  };
  look_at(most_r2);
  if (const double k2 = model.vignetting[1]; k2 != 0) {
    const double vertex = -model.vignetting[0] / (2 * k2);
    if (vertex > 0 && vertex < most_r2) look_at(vertex);
  }
  if (!(least >= M::kMinLight && most <= M::kMaxLight))
    return "vignetting: must leave " + number_text(M::kMinLight) + " to " + number_text(M::kMaxLight) +
           " of the light in all of the image";
  return std::nullopt;
}

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
    for (int i = 0; i < 3; i++) tables_.matrix[k][i] = fixed(std::clamp(affine.of[k][i], -kMaxSlope, kMaxSlope), 13);
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
  if (most < kMinRest) tables_.rest.clear();
}

void ColourCorrection::tabulate_factor(const ColourModel& model, int width, int height, const Vec2& centre) {
  const VignettingField field(width, height, centre);
  // Interpolates between 1024 steps of r^2 instead of computing a power for each sample.
  constexpr int kSteps = 1024;
  std::vector<double> of_square;
  for (int i = 0; i <= kSteps; i++)
    of_square.push_back(level_factor(vignetting_factor(model, field.most() * i / kSteps)));
  const auto factor = [&](double x, double y) {
    const double at = std::clamp(field.square(x, y) / field.most(), 0.0, 1.0) * kSteps;
    const int i = std::min(static_cast<int>(at), kSteps - 1);
    return of_square[i] + (at - i) * (of_square[i + 1] - of_square[i]);
  };
  const bool rgb = family_ == PixelFamily::kRgb;
  const int columns = rgb ? width : chroma_size(width), rows = rgb ? height : chroma_size(height);
  const double step = rgb ? 1 : 2, first = rgb ? 0 : 0.5;
  tables_.factor_columns = columns;
  for (int row = 0; row < rows + kFactorRowStep; row += kFactorRowStep)
    for (int x = 0; x < columns; x++) tables_.factor.push_back(fixed(factor(step * x + first, step * row + first), 14));
}

ImageView ColourCorrection::apply(const ImageView& image, const Rect& rect, ByteBuffer& memory) const {
  PlaneCopy planes[3];
  const ImageView out = write_copy(image, rect, memory, [&](const PlaneCopy& plane) { planes[plane.index] = plane; });
  if (family_ == PixelFamily::kRgb)
    HWY_DYNAMIC_DISPATCH(rgb)(tables_, planes[0], image.layout);
  else
    HWY_DYNAMIC_DISPATCH(i420)(tables_, planes[0], planes[1], planes[2]);
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
#endif
