// SPDX-License-Identifier: LGPL-2.1-or-later
#include "composite/resolve.h"

#include <algorithm>

#include "render/sum_planes.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "composite/resolve.cc"
#include <hwy/foreach_target.h>  // must precede highway.h
#include <hwy/highway.h>

#include "base/for_lanes-inl.h"

HWY_BEFORE_NAMESPACE();
namespace lf::HWY_NAMESPACE {

template <class D, class V, typename T>
HWY_INLINE void add_to(D d, T* to, V v) {
  hn::StoreU(hn::SaturatedAdd(hn::LoadU(d, to), v), d, to);
}

template <class D, class V>
HWY_INLINE auto levels(D d, V bytes) {
  return hn::ShiftLeft<kSumFractionBits>(hn::PromoteTo(d, bytes));
}
template <typename Byte, class D>
HWY_INLINE auto load_levels(D d, const Byte* from) {
  return levels(d, hn::LoadU(hn::Rebind<Byte, D>(), from));
}

void add_bytes(int16_t* HWY_RESTRICT sum, const uint8_t* HWY_RESTRICT in, int n) {
  for_lanes<int16_t>(n, [&](auto d, int i) HWY_ATTR { add_to(d, sum + i, load_levels(d, in + i)); });
}

void add_signed_bytes(int16_t* HWY_RESTRICT sum, const int8_t* HWY_RESTRICT in, int n) {
  for_lanes<int16_t>(n, [&](auto d, int i) HWY_ATTR { add_to(d, sum + i, load_levels(d, in + i)); });
}

void add_rgb(int16_t* HWY_RESTRICT r, int16_t* HWY_RESTRICT g, int16_t* HWY_RESTRICT b, const uint8_t* HWY_RESTRICT in,
             int n) {
  for_lanes<int16_t>(n, [&](auto d, int i) HWY_ATTR {
    const hn::Rebind<uint8_t, decltype(d)> d8;
    hn::Vec<decltype(d8)> red, green, blue;
    if constexpr (hn::MaxLanes(d) == 1) {  // interleaved loads read whole vectors
      red = hn::Set(d8, in[3 * i]);
      green = hn::Set(d8, in[3 * i + 1]);
      blue = hn::Set(d8, in[3 * i + 2]);
    } else {
      hn::LoadInterleaved3(d8, in + 3 * i, red, green, blue);
    }
    add_to(d, r + i, levels(d, red));
    add_to(d, g + i, levels(d, green));
    add_to(d, b + i, levels(d, blue));
  });
}

// n / 255 in units of 1 / kMissingOne, rounded to nearest: 128 n + (n + 1) / 2 = n * 32768 / 255.
void add_missing_weight(uint16_t* HWY_RESTRICT lost, const uint8_t* HWY_RESTRICT in, int n) {
  for_lanes<uint16_t>(n, [&](auto d, int i) HWY_ATTR {
    const auto v = hn::PromoteTo(d, hn::LoadU(hn::Rebind<uint8_t, decltype(d)>(), in + i));
    add_to(d, lost + i, hn::Add(hn::ShiftLeft<7>(v), hn::ShiftRight<1>(hn::Add(v, hn::Set(d, 1)))));
  });
}

void add_sums(int16_t* HWY_RESTRICT sum, const int16_t* HWY_RESTRICT in, int n) {
  for_lanes<int16_t>(n, [&](auto d, int i) HWY_ATTR { add_to(d, sum + i, hn::LoadU(d, in + i)); });
}

void add_missing_sums(uint16_t* HWY_RESTRICT lost, const uint16_t* HWY_RESTRICT in, int n) {
  for_lanes<uint16_t>(n, [&](auto d, int i) HWY_ATTR { add_to(d, lost + i, hn::LoadU(d, in + i)); });
}

void scales_of(float* HWY_RESTRICT scale, const uint16_t* HWY_RESTRICT lost, int n) {
  for_lanes<float>(n, [&](auto d, int i) HWY_ATTR {
    const hn::Rebind<int32_t, decltype(d)> d32;
    const hn::Rebind<uint16_t, decltype(d)> d16;
    const auto missing_weight = hn::ConvertTo(d, hn::PromoteTo(d32, hn::LoadU(d16, lost + i)));
    const auto left = hn::Sub(hn::Set(d, kMissingOne), missing_weight);
    const auto enough = hn::Ge(left, hn::Set(d, kMinWeight));
    const auto one = hn::Set(d, kMissingOne / static_cast<float>(1 << kSumFractionBits));
    hn::StoreU(hn::IfThenElseZero(enough, hn::Div(one, left)), d, scale + i);
  });
}

template <class D, class V>
HWY_INLINE auto to_bytes(D d, V v) {
  const auto level = hn::Min(hn::Max(hn::Add(v, hn::Set(d, 0.5f)), hn::Zero(d)), hn::Set(d, 255.f));
  return hn::DemoteTo(hn::Rebind<uint8_t, D>(), hn::ConvertTo(hn::Rebind<int32_t, D>(), level));
}

// Requires factor < 1.
void written(uint8_t* HWY_RESTRICT out, const int16_t* HWY_RESTRICT sum, float factor, float offset, int n) {
  const auto fixed = static_cast<int16_t>(factor * 32768 + 0.5f);
  const auto added = static_cast<int16_t>(offset * (1 << kSumFractionBits) + (1 << (kSumFractionBits - 1)));
  for_lanes<int16_t>(n, [&](auto d, int i) HWY_ATTR {
    const auto level =
        hn::SaturatedAdd(hn::MulFixedPoint15(hn::LoadU(d, sum + i), hn::Set(d, fixed)), hn::Set(d, added));
    const hn::Rebind<uint8_t, decltype(d)> d8;
    hn::StoreU(hn::DemoteTo(d8, hn::ShiftRight<kSumFractionBits>(level)), d8, out + i);
  });
}

void scaled(uint8_t* HWY_RESTRICT out, const int16_t* HWY_RESTRICT sum, const float* HWY_RESTRICT scale,
            float background, float gain, float offset, int n) {
  for_lanes<float>(n, [&](auto d, int i) HWY_ATTR {
    const hn::Rebind<int32_t, decltype(d)> d32;
    const hn::Rebind<int16_t, decltype(d)> d16;
    const hn::Rebind<uint8_t, decltype(d)> d8;
    const auto s = hn::LoadU(d, scale + i);
    const auto value = hn::Mul(hn::ConvertTo(d, hn::PromoteTo(d32, hn::LoadU(d16, sum + i))), s);
    const auto shown = hn::IfThenElse(hn::Eq(s, hn::Zero(d)), hn::Set(d, background), value);
    const auto level = hn::Add(hn::Mul(shown, hn::Set(d, gain)), hn::Set(d, offset));
    hn::StoreU(to_bytes(d, level), d8, out + i);
  });
}

// Plain loops that the compiler vectorizes for each instruction set. They must not use std:: functions.

HWY_INLINE int32_t at_most_one(uint16_t lost) { return lost < kMissingOne ? lost : kMissingOne; }

void pairs_of(int32_t* HWY_RESTRICT lost, int32_t* HWY_RESTRICT hidden, const uint16_t* HWY_RESTRICT missing_of_row,
              const float* HWY_RESTRICT row_scale, int w) {
  const int pairs = w / 2;
  if (missing_of_row)
    for (int i = 0; i < pairs; i++)
      lost[i] += at_most_one(missing_of_row[2 * i]) + at_most_one(missing_of_row[2 * i + 1]);
  for (int i = 0; i < pairs; i++) hidden[i] += (row_scale[2 * i] == 0) + (row_scale[2 * i + 1] == 0);
  if (w % 2 == 0) return;
  if (missing_of_row) lost[pairs] += at_most_one(missing_of_row[w - 1]);
  hidden[pairs] += row_scale[w - 1] == 0;
}

void chroma_scales_of(float* HWY_RESTRICT scale, float* HWY_RESTRICT share, const int32_t* HWY_RESTRICT lost,
                      const int32_t* HWY_RESTRICT hidden, float pixels, int n) {
  constexpr float kOne = kMissingOne / static_cast<float>(1 << kSumFractionBits);
  for (int i = 0; i < n; i++) {
    const float left = kMissingOne - static_cast<float>(lost[i]) / pixels;
    const float enough = left < kMinWeight ? 0.f : 1.f, some = left < kMinWeight ? 1.f : left;
    scale[i] = enough * (kOne / some);
    share[i] = (1 - enough) + enough * (static_cast<float>(hidden[i]) / pixels);
  }
}

void scaled_chroma(uint8_t* HWY_RESTRICT out, const int16_t* HWY_RESTRICT sum, const float* HWY_RESTRICT scale,
                   const float* HWY_RESTRICT share, float background, float gain, int n) {
  for_lanes<float>(n, [&](auto d, int i) HWY_ATTR {
    const hn::Rebind<int32_t, decltype(d)> d32;
    const hn::Rebind<int16_t, decltype(d)> d16;
    const hn::Rebind<uint8_t, decltype(d)> d8;
    const auto value = hn::ConvertTo(d, hn::PromoteTo(d32, hn::LoadU(d16, sum + i)));
    const auto colour =
        hn::Min(hn::Max(hn::Mul(value, hn::LoadU(d, scale + i)), hn::Set(d, -128.f)), hn::Set(d, 127.f));
    const auto back = hn::LoadU(d, share + i);
    const auto shown = hn::Add(hn::Mul(colour, hn::Sub(hn::Set(d, 1), back)), hn::Mul(hn::Set(d, background), back));
    const auto level = hn::Add(hn::Set(d, 128), hn::Mul(shown, hn::Set(d, gain)));
    hn::StoreU(to_bytes(d, level), d8, out + i);
  });
}

}  // namespace lf::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace lf {

HWY_EXPORT(add_bytes);
HWY_EXPORT(add_signed_bytes);
HWY_EXPORT(add_rgb);
HWY_EXPORT(add_missing_weight);
HWY_EXPORT(add_sums);
HWY_EXPORT(add_missing_sums);

void add_row(int16_t* sum, const uint8_t* in, int n) { HWY_DYNAMIC_DISPATCH(add_bytes)(sum, in, n); }
void add_chroma_row(int16_t* sum, const uint8_t* in, int n) {
  HWY_DYNAMIC_DISPATCH(add_signed_bytes)(sum, reinterpret_cast<const int8_t*>(in), n);
}
void add_rgb_row(int16_t* r, int16_t* g, int16_t* b, const uint8_t* in, int n) {
  HWY_DYNAMIC_DISPATCH(add_rgb)(r, g, b, in, n);
}
void add_missing_row(uint16_t* lost, const uint8_t* in, int n) {
  HWY_DYNAMIC_DISPATCH(add_missing_weight)(lost, in, n);
}
void add_sum_row(int16_t* sum, const int16_t* in, int n) { HWY_DYNAMIC_DISPATCH(add_sums)(sum, in, n); }
void add_sum_row(uint16_t* lost, const uint16_t* in, int n) { HWY_DYNAMIC_DISPATCH(add_missing_sums)(lost, in, n); }

HWY_EXPORT(scales_of);
HWY_EXPORT(written);
HWY_EXPORT(scaled);
HWY_EXPORT(pairs_of);
HWY_EXPORT(chroma_scales_of);
HWY_EXPORT(scaled_chroma);

void make_scales(float* scale, const uint16_t* lost, int n) { HWY_DYNAMIC_DISPATCH(scales_of)(scale, lost, n); }
void write_row(uint8_t* out, const int16_t* sum, const Levels& levels, int n) {
  HWY_DYNAMIC_DISPATCH(written)(out, sum, levels.gain, levels.offset, n);
}
void write_chroma_row(uint8_t* out, const int16_t* sum, const Levels& levels, int n) {
  HWY_DYNAMIC_DISPATCH(written)(out, sum, levels.chroma_gain, 128, n);
}
void scale_row(uint8_t* out, const int16_t* sum, const float* scale, float background, const Levels& levels, int n) {
  HWY_DYNAMIC_DISPATCH(scaled)(out, sum, scale, background, levels.gain, levels.offset, n);
}

void add_pairs(int32_t* lost, int32_t* hidden, const uint16_t* missing_of_row, const float* row_scale, int w) {
  HWY_DYNAMIC_DISPATCH(pairs_of)(lost, hidden, missing_of_row, row_scale, w);
}
void make_chroma_scales(float* scale, float* share, const int32_t* lost, const int32_t* hidden, float pixels, int n) {
  HWY_DYNAMIC_DISPATCH(chroma_scales_of)(scale, share, lost, hidden, pixels, n);
}
void scale_chroma_row(uint8_t* out, const int16_t* sum, const float* scale, const float* share, float background,
                      const Levels& levels, int n) {
  HWY_DYNAMIC_DISPATCH(scaled_chroma)(out, sum, scale, share, background, levels.chroma_gain, n);
}

namespace {

constexpr float kOneLevel = 1 << kSumFractionBits;

template <typename T>
bool any_set(const T* values, int n) {
  T any = 0;
  for (int i = 0; i < n; i++) any |= values[i];
  return any != 0;
}

void hide(float* __restrict scale, const uint8_t* __restrict uncovered, int n) {
  for (int i = 0; i < n; i++) scale[i] = uncovered[i] ? 0.f : scale[i];
}

// Rows are processed in parts of this many pixels. In a partly covered view, few parts then need more than rounding.
constexpr int kPart = 128;
constexpr int kChromaPart = kPart / 2;

class Weights {
 public:
  Weights(const ConstSumPlanes& sum, const uint8_t* uncovered)
      : sum_(sum), uncovered_(uncovered), width_(sum.rect.width()) {}

  const uint16_t* lost(int x, int y) const { return sum_.lost ? sum_.lost + y * sum_.missing_stride + x : nullptr; }
  bool rounds_only(int y) const {
    return !(sum_.lost && any_set(lost(0, y), width_)) && !(uncovered_ && any_set(hidden(0, y), width_));
  }
  // Computes the scale factors for `n` pixels of row y from x on; 0 means that the background shows. Returns false if
  // the part only needs rounding.
  bool scales(int x, int y, int n, float* scale) const {
    const bool some_missing = sum_.lost && any_set(lost(x, y), n), some_hidden = uncovered_ && any_set(hidden(x, y), n);
    if (!some_missing && !some_hidden) return false;
    if (some_missing)
      make_scales(scale, lost(x, y), n);
    else
      std::fill_n(scale, n, 1 / kOneLevel);
    if (some_hidden) hide(scale, hidden(x, y), n);
    return true;
  }

 private:
  const uint8_t* hidden(int x, int y) const { return uncovered_ + static_cast<size_t>(y) * width_ + x; }

  const ConstSumPlanes& sum_;
  const uint8_t* uncovered_;
  int width_;
};

void interleave(uint8_t* __restrict out, const RgbLayout& layout, const uint8_t* __restrict r,
                const uint8_t* __restrict g, const uint8_t* __restrict b, int n) {
  const int step = layout.pixel_stride, opaque = 6 - layout.r - layout.g - layout.b;
  for (int x = 0; x < n; x++) {
    out[step * x + layout.r] = r[x];
    out[step * x + layout.g] = g[x];
    out[step * x + layout.b] = b[x];
    if (step == 4) out[step * x + opaque] = 255;
  }
}

void resolve_rgb(const ConstSumPlanes& sum, const Weights& weights, const Background& background,
                 const RgbLayout& layout, uint8_t* plane, ptrdiff_t stride) {
  const int w = sum.rect.width();
  const float back[3] = {static_cast<float>(background.r), static_cast<float>(background.g),
                         static_cast<float>(background.b)};
  float scale[kPart];
  uint8_t row[3][kPart];
  for (int y = 0; y < sum.rect.height(); y++)
    for (int x = 0; x < w; x += kPart) {
      const int n = std::min(kPart, w - x);
      const int16_t* const in[3] = {sum.plane[0] + y * sum.stride[0] + x, sum.plane[1] + y * sum.stride[1] + x,
                                    sum.plane[2] + y * sum.stride[2] + x};
      uint8_t* const out = plane + y * stride + static_cast<ptrdiff_t>(x) * layout.pixel_stride;
      if (!weights.scales(x, y, n, scale)) {
        round_rgb_row(out, layout, in[0], in[1], in[2], n);
        continue;
      }
      for (int c = 0; c < 3; c++) scale_row(row[c], in[c], scale, back[c], kFullLevels, n);
      interleave(out, layout, row[0], row[1], row[2], n);
    }
}

void interleave(uint8_t* __restrict out, const uint8_t* __restrict cb, const uint8_t* __restrict cr, int n) {
  for (int x = 0; x < n; x++) {
    out[2 * x] = cb[x];
    out[2 * x + 1] = cr[x];
  }
}

struct Planar {
  const ConstSumPlanes& sum;
  const Weights& weights;
  YCbCr back;
  Levels levels;
  uint8_t* const* plane;
  const ptrdiff_t* stride;

  void round_luma(uint8_t* out, const int16_t* in, int n) const {
    levels == kFullLevels ? round_row(out, in, n) : write_row(out, in, levels, n);
  }
  void round_chroma(uint8_t* out, const int16_t* in, int n) const {
    levels == kFullLevels ? round_chroma_row(out, in, n, 128) : write_chroma_row(out, in, levels, n);
  }
};

void resolve_whole(const Planar& to, int cy, int rows) {
  const int w = to.sum.rect.width(), cw = chroma_size(w);
  for (int y = 2 * cy; y < 2 * cy + rows; y++)
    to.round_luma(to.plane[0] + y * to.stride[0], to.sum.plane[0] + y * to.sum.stride[0], w);
  const int16_t* const in[2] = {to.sum.plane[1] + cy * to.sum.stride[1], to.sum.plane[2] + cy * to.sum.stride[2]};
  if (chroma_step(to.plane) == 1) {
    for (int c = 1; c < 3; c++) to.round_chroma(to.plane[c] + cy * to.stride[c], in[c - 1], cw);
    return;
  }
  uint8_t row[2][kChromaPart];
  for (int cx = 0; cx < cw; cx += kChromaPart) {
    const int n = std::min(kChromaPart, cw - cx);
    for (int c = 0; c < 2; c++) to.round_chroma(row[c], in[c] + cx, n);
    interleave(to.plane[1] + cy * to.stride[1] + 2 * cx, row[0], row[1], n);
  }
}

// Writes `w` pixels from x of the chroma row cy and its one or two luma rows. `w` is at most kPart, and even except at
// the right border.
void resolve_part(const Planar& to, int x, int w, int cy, int rows) {
  const int cw = chroma_size(w), cx = x / 2;
  float scale[kPart], share[kChromaPart], chroma_scale[kChromaPart];
  int32_t lost[kChromaPart] = {}, hidden[kChromaPart] = {};
  bool plain = true;
  for (int y = 2 * cy; y < 2 * cy + rows; y++) {
    const int16_t* const in = to.sum.plane[0] + y * to.sum.stride[0] + x;
    uint8_t* const out = to.plane[0] + y * to.stride[0] + x;
    if (!to.weights.scales(x, y, w, scale)) {
      to.round_luma(out, in, w);
      continue;
    }
    plain = false;
    scale_row(out, in, scale, to.back.y, to.levels, w);
    add_pairs(lost, hidden, to.weights.lost(x, y), scale, w);
  }
  if (!plain) {
    const int pairs = w / 2;
    const auto pixels = static_cast<float>(rows);
    make_chroma_scales(chroma_scale, share, lost, hidden, 2 * pixels, pairs);
    if (cw > pairs) make_chroma_scales(&chroma_scale[pairs], &share[pairs], &lost[pairs], &hidden[pairs], pixels, 1);
  }
  const bool interleaved = chroma_step(to.plane) == 2;
  uint8_t rows_of_chroma[2][kChromaPart];
  for (int c = 1; c < 3; c++) {
    const int16_t* const in = to.sum.plane[c] + cy * to.sum.stride[c] + cx;
    uint8_t* const out = interleaved ? rows_of_chroma[c - 1] : to.plane[c] + cy * to.stride[c] + cx;
    if (plain)
      to.round_chroma(out, in, cw);
    else
      scale_chroma_row(out, in, chroma_scale, share, c == 1 ? to.back.cb : to.back.cr, to.levels, cw);
  }
  if (interleaved) interleave(to.plane[1] + cy * to.stride[1] + 2 * cx, rows_of_chroma[0], rows_of_chroma[1], cw);
}

void resolve_i420(const Planar& to) {
  const int w = to.sum.rect.width(), h = to.sum.rect.height();
  for (int cy = 0; cy < chroma_size(h); cy++) {
    const int rows = std::min(2, h - 2 * cy);
    if (to.weights.rounds_only(2 * cy) && to.weights.rounds_only(2 * cy + rows - 1))
      resolve_whole(to, cy, rows);
    else
      for (int x = 0; x < w; x += kPart) resolve_part(to, x, std::min(kPart, w - x), cy, rows);
  }
}

}  // namespace

void resolve(const ConstSumPlanes& sum, const uint8_t* uncovered, const Background& background, const RgbLayout& layout,
             uint8_t* const plane[3], const ptrdiff_t stride[3], const Levels& levels) {
  const Weights weights(sum, uncovered);
  if (sum.family == PixelFamily::kRgb) resolve_rgb(sum, weights, background, layout, plane[0], stride[0]);
  if (sum.family == PixelFamily::kI420)
    resolve_i420({sum, weights, ycbcr_of(background.r, background.g, background.b), levels, plane, stride});
}

namespace {

constexpr int kNone = kMissingOne / 8, kFull = kMissingOne / 4;  // thresholds of the remaining weight
constexpr int kMixBits = 8;

int share_before(int lost) {
  const int left = kMissingOne - std::min(lost, kMissingOne);
  if (left >= kFull) return 0;
  return ((kFull - std::max(left, kNone)) << kMixBits) / (kFull - kNone);
}

void mix(uint8_t& value, uint8_t before, int share) {
  value = static_cast<uint8_t>(value + (((before - value) * share + (1 << (kMixBits - 1))) >> kMixBits));
}

}  // namespace

void conceal(const ConstSumPlanes& sum, const ImageView& before, uint8_t* const plane[3], const ptrdiff_t stride[3]) {
  if (!sum.lost) return;
  const int width = sum.rect.width(), height = sum.rect.height();
  const int bytes = sum.family == PixelFamily::kRgb ? before.layout.pixel_stride : 1;
  for (int y = 0; y < height; y++) {
    const uint16_t* lost = sum.lost + y * sum.missing_stride;
    const uint8_t* from = before.plane[0] + y * before.stride[0];
    uint8_t* to = plane[0] + y * stride[0];
    for (int x = 0; x < width; x++) {
      const int share = share_before(lost[x]);
      if (share == 0) continue;
      for (int i = x * bytes; i < (x + 1) * bytes; i++) mix(to[i], from[i], share);
    }
  }
  if (sum.family != PixelFamily::kI420) return;
  const int step = chroma_step(plane), step_before = chroma_step(before.plane);
  for (int cy = 0; cy < chroma_size(height); cy++)
    for (int cx = 0; cx < chroma_size(width); cx++) {
      const int x1 = std::min(2 * cx + 1, width - 1), y1 = std::min(2 * cy + 1, height - 1);
      const uint16_t *top = sum.lost + 2 * cy * sum.missing_stride, *bottom = sum.lost + y1 * sum.missing_stride;
      const int share = share_before((top[2 * cx] + top[x1] + bottom[2 * cx] + bottom[x1]) / 4);
      if (share == 0) continue;
      for (int c = 1; c < 3; c++)
        mix(plane[c][cy * stride[c] + step * cx], before.plane[c][cy * before.stride[c] + step_before * cx], share);
    }
}

}  // namespace lf
#endif
