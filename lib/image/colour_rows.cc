// SPDX-License-Identifier: LGPL-2.1-or-later
#include "image/colour_rows.h"

#include <algorithm>
#include <cstring>

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "image/colour_rows.cc"
#include <hwy/foreach_target.h>  // has to precede highway.h
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace lf::HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

using Tables = ColourCorrection::Tables;
using D = hn::ScalableTag<int16_t>;
using V = hn::Vec<D>;
// Bytes, one for each lane.
using D8 = hn::Rebind<uint8_t, D>;
inline constexpr D d;
inline constexpr int kMostLanes = 64;  // of any instruction set that this is compiled for, and more

HWY_INLINE V set(int value) { return hn::Set(d, static_cast<int16_t>(value)); }
// a b of numbers with `fraction` bits is one with 15 bits less than both have.
HWY_INLINE V times(V a, V b) { return hn::MulFixedPoint15(a, b); }
HWY_INLINE V plus(V a, V b) { return hn::SaturatedAdd(a, b); }

// Three numbers for each of as many colours as a vector has lanes.
struct Triple {
  V of[3];
};

// Pixels with an even place in a row, and with an odd one: 7 bits of fraction.
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

// Levels of 0 to 255.
HWY_INLINE void store_pairs(const Pairs& level, uint8_t* to) {
  const hn::Repartition<uint8_t, D> d8x2;
  hn::StoreU(hn::BitCast(d8x2, hn::Or(level.even, hn::ShiftLeft<8>(level.odd))), d8x2, to);
}

// Of the table: 5 bits of fraction.
HWY_INLINE Triple rest_at(const uint32_t* table, V index) {
  const hn::Repartition<int32_t, D> d32;
  const auto* const from = reinterpret_cast<const int32_t*>(table);
  const auto pairs = hn::BitCast(d32, index);
  const auto even = hn::GatherIndex(d32, from, hn::And(pairs, hn::Set(d32, 0xffff)));
  const auto odd = hn::GatherIndex(d32, from, hn::ShiftRight<16>(pairs));
  // Ten bits become 16: where the first of a pair has them, and where the second has.
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

// Of three levels, 0 to 255.
HWY_INLINE V table_index(V a, V b, V c) {
  const V high = set(0xf8);
  return hn::Or(hn::ShiftLeft<7>(hn::And(a, high)), hn::Or(hn::ShiftLeft<2>(hn::And(b, high)), hn::ShiftRight<3>(c)));
}

HWY_INLINE V mean_of(V a, V b) {
  const hn::RebindToUnsigned<D> du;
  return hn::BitCast(d, hn::AverageRound(hn::BitCast(du, a), hn::BitCast(du, b)));
}

// What a row of samples has in common.
struct Row {
  const int16_t *above, *below;  // factors, from the first sample on
  int16_t between;               // 15 bits of fraction

  Row(const Tables& tables, int y, int x0) {
    constexpr int kApart = ColourCorrection::kRowsApart;
    above = tables.factor.data() + static_cast<ptrdiff_t>(y / kApart) * tables.factor_columns + x0;
    below = above + tables.factor_columns;
    between = static_cast<int16_t>(y % kApart * (32768 / kApart));
  }
  HWY_INLINE V at(int i) const {
    const V a = hn::LoadU(d, above + i);
    return hn::Add(a, times(hn::Sub(hn::LoadU(d, below + i), a), set(between)));
  }
};

// Bytes of 2 x 2 pixels for each lane, and where they go.
struct Quads {
  const uint8_t *upper, *lower, *cb, *cr;
  uint8_t *out_upper, *out_lower, *out_cb, *out_cr;
};

// Levels have 7 bits of fraction, sums 5, sums times the lens's factor 4: 16 bits hold twice 255 and what is negative.
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
  if (!half_last && n >= lanes) {  // some twice
    quads<kHasRest>(t, at(n - lanes), factors.at(n - lanes));
    return;
  }
  // What is left of a row that is short, or ends with half a pair.
  alignas(64) uint8_t in[4][2 * kMostLanes] = {}, out[4][2 * kMostLanes];
  alignas(64) int16_t factor[kMostLanes] = {};
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
  // The last column of chroma is of one column of luma where an image has an odd width.
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
    alignas(64) uint8_t in[4 * kMostLanes] = {}, out[4 * kMostLanes];
    alignas(64) int16_t factor[kMostLanes] = {};
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

HWY_EXPORT(i420);
HWY_EXPORT(rgb);

void correct_i420(const ColourCorrection::Tables& tables, const PlaneCopy& y, const PlaneCopy& cb,
                  const PlaneCopy& cr) {
  HWY_DYNAMIC_DISPATCH(i420)(tables, y, cb, cr);
}

void correct_rgb(const ColourCorrection::Tables& tables, const PlaneCopy& plane, const RgbLayout& layout) {
  HWY_DYNAMIC_DISPATCH(rgb)(tables, plane, layout);
}

}  // namespace lf
#endif
