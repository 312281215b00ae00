// SPDX-License-Identifier: LGPL-2.1-or-later
// Per target, see render_band.cc: weights where three in a row of a block tell them all.
#if defined(LF_RENDER_SIMD_SMOOTH_WEIGHTS_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef LF_RENDER_SIMD_SMOOTH_WEIGHTS_INL_H_
#undef LF_RENDER_SIMD_SMOOTH_WEIGHTS_INL_H_
#else
#define LF_RENDER_SIMD_SMOOTH_WEIGHTS_INL_H_
#endif

#include <hwy/highway.h>

#include "render/simd/band_data.h"
#include "render/simd/positions-inl.h"

HWY_BEFORE_NAMESPACE();
namespace lf::simd::HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

#if HWY_TARGET == HWY_SCALAR

inline bool fit_weights(const FacePlan&, const Rays&, int, int, FaceBlock&) { return false; }
inline void spread_weights(const FaceBlock&, Scratch&) {}

#else

// Weights in the making are unsigned, so that one may come out slightly below 0: half of 1 higher than they are, and
// half a unit for rounding.
inline constexpr uint32_t kWeightOffset = (1u << 29) + (1u << 14);

// The most that the parabola through three weights (at t = 0, 1/2 and 1) may miss those between by: by 0.0481 c^2 rise,
// where the sum of the edge functions changes by the fraction c of itself along a block, and the weight by `rise`.
inline constexpr float kLargestMiss = 1e-5f;

// Fits the weights of a face in the rows from y on of the block at x. False if they aren't smooth enough, which depends
// on nothing else, so that everybody decides alike.
inline bool fit_weights(const FacePlan& face, const Rays& rays, int x, int y, FaceBlock& out) {
  if (!rays.separable()) return false;
  const hn::CappedTag<float, kBandRows> d;
  const hn::RebindToUnsigned<decltype(d)> du;
  const Vec2 corner = rays.at(x, y), next = rays.at(x + kBlock / 2, y + 1);
  const double u_half = next.x - corner.x, v_step = next.y - corner.y;
  double start[3], half[3], down[3];
  for (int k = 0; k < 3; k++) {
    start[k] = FacePlan::evaluate(face.edge[k], corner);
    half[k] = face.edge[k].x * u_half;
    down[k] = face.edge[k].y * v_step;
  }
  const auto set = [&](double v) HWY_ATTR { return hn::Set(d, static_cast<float>(v)); };
  const auto sum_start = set(start[0] + start[1] + start[2]), sum_half = set(half[0] + half[1] + half[2]),
             sum_down = set(down[0] + down[1] + down[2]);
  auto all = hn::Eq(sum_start, sum_start);
  for (int row = 0; row < kBandRows; row += static_cast<int>(hn::Lanes(d))) {
    const auto j = hn::Iota(d, static_cast<float>(row));
    const auto sum0 = hn::MulAdd(j, sum_down, sum_start), sum1 = hn::Add(sum0, sum_half),
               sum2 = hn::Add(sum1, sum_half);
    const auto scale0 = hn::Div(set(1), sum0), scale1 = hn::Div(set(1), sum1), scale2 = hn::Div(set(1), sum2);
    auto largest_rise = hn::Zero(d);
    for (int k = 0; k < 3; k++) {
      const auto e0 = hn::MulAdd(j, set(down[k]), set(start[k]));
      const auto e1 = hn::Add(e0, set(half[k])), e2 = hn::Add(e1, set(half[k]));
      const auto w0 = hn::Mul(e0, scale0), w1 = hn::Mul(e1, scale1), w2 = hn::Mul(e2, scale2);
      const auto rise = hn::Sub(w2, w0), bend = hn::NegMulAdd(set(2), w1, hn::Add(w0, w2));
      largest_rise = hn::Max(largest_rise, hn::Abs(rise));
      // As in to_low_bits(): what shifting leaves of the low bits is `at` in units of 2^-20.
      constexpr int kShift = 10;
      static_assert(kWeightOffset % (1 << kShift) == 0);
      const auto at = hn::MulAdd(w0, set(1 << 20), set(kMagic + static_cast<float>(kWeightOffset >> kShift)));
      hn::Store(hn::ShiftLeft<kShift>(hn::BitCast(du, at)), du, out.at[k] + row);
      const auto low = hn::And(hn::BitCast(du, hn::MulAdd(rise, set(32768), set(kMagic))), hn::Set(du, 0xffff));
      const auto high = hn::ShiftLeft<16>(hn::BitCast(du, hn::MulAdd(bend, set(8 * 32768), set(kMagic))));
      hn::Store(hn::Or(low, high), du, out.rise_bend[k] + row);
    }
    // A sum that changes its sign changes by more than it is.
    const auto change = hn::Abs(hn::Mul(hn::Add(sum_half, sum_half), scale1));
    const auto miss = hn::Mul(hn::Mul(change, change), hn::Mul(largest_rise, set(0.0481)));
    const auto fits = hn::And(hn::Lt(change, set(0.125)), hn::Lt(largest_rise, set(0.99)));
    all = hn::And(all, hn::And(fits, hn::Lt(miss, set(kLargestMiss))));
  }
  return hn::AllTrue(d, all);
}

// Factors of rise and bend in the even and in the odd pixels of a block, pairs of 2^15 = 1, and masks of 16 lanes that
// begin or end anywhere.
struct SpreadTable {
  alignas(64) int16_t even[kBlock], odd[kBlock];
  alignas(64) int16_t from[2 * kBlock], to[2 * kBlock];
};
constexpr SpreadTable make_spread_table() {
  SpreadTable table{};
  for (int i = 0; i < kBlock; i++) {
    const int t = i * (32768 / kBlock), t_next = 32768 - t;
    int16_t* const pair = (i % 2 ? table.odd : table.even) + i / 2 * 2;
    pair[0] = static_cast<int16_t>(t);
    pair[1] = static_cast<int16_t>(-(t / 4 * (t_next / 8) / (32768 / 8)));
    table.from[kBlock + i] = table.to[i] = -1;
  }
  return table;
}
inline constexpr SpreadTable kSpread = make_spread_table();

// Writes the weights of the pixels of `face`, which is smooth, beside what is there of others.
inline void spread_weights(const FaceBlock& face, Scratch& scratch) {
  const hn::CappedTag<int16_t, kBlock> d;
  const hn::RebindToUnsigned<decltype(d)> du;
  const hn::Repartition<uint32_t, decltype(d)> d32;
  const hn::Repartition<int32_t, decltype(d)> di32;
  BlockWeights* out[3];
  int corner[3], count = 0;
  for (int k = 0; k < 3; k++)
    if (face.corners >> k & 1) {
      out[count] = &scratch.weights[face.entry[k]];
      out[count]->rows |= face.rows;
      corner[count++] = k;
    }
  for (size_t lane = 0; lane < kBlock; lane += hn::Lanes(d)) {
    const auto even = hn::Load(d, kSpread.even + lane), odd = hn::Load(d, kSpread.odd + lane);
    for (uint32_t rows = face.rows; rows != 0; rows &= rows - 1) {
      const size_t r = hwy::Num0BitsBelowLS1Bit_Nonzero32(rows);
      const auto inside = hn::And(hn::LoadU(d, kSpread.from + kBlock - face.x0[r] + lane),
                                  hn::LoadU(d, kSpread.to + kBlock - face.x1[r] + lane));
      const auto spread = [&](int k, int16_t* to) HWY_ATTR {
        const auto factors = hn::BitCast(d, hn::Set(d32, face.rise_bend[k][r]));
        const auto at = hn::BitCast(di32, hn::Set(d32, face.at[k][r]));
        const auto sum_of = [&](const auto places) HWY_ATTR {
          auto other = hn::Zero(di32);
          const auto sum = hn::ReorderWidenMulAccumulate(di32, factors, places, at, other);
          return hn::BitCast(d32, hn::RearrangeToOddPlusEven(sum, other));
        };
        const auto low = hn::BitCast(du, hn::ShiftRight<15>(sum_of(even)));
        const auto high = hn::BitCast(du, hn::ShiftLeft<1>(sum_of(odd)));
        const auto w = hn::SaturatedSub(hn::OddEven(high, low), hn::Set(du, 1 << 14));
        const auto w16 = hn::BitCast(d, hn::Min(w, hn::Set(du, 32767)));
        hn::Store(hn::Or(hn::Load(d, to + lane), hn::And(w16, inside)), d, to + lane);
      };
      if (HWY_LIKELY(count == 3)) {
        spread(0, out[0]->w[r]);
        spread(1, out[1]->w[r]);
        spread(2, out[2]->w[r]);
      } else {
        for (int i = 0; i < count; i++) spread(corner[i], out[i]->w[r]);
      }
    }
  }
}

#endif

}  // namespace lf::simd::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();
#endif
