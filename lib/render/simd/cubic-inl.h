// SPDX-License-Identifier: LGPL-2.1-or-later
// Per target, see render_band.cc: Catmull-Rom samples of one plane and row of a block.
#if defined(LF_RENDER_SIMD_CUBIC_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef LF_RENDER_SIMD_CUBIC_INL_H_
#undef LF_RENDER_SIMD_CUBIC_INL_H_
#else
#define LF_RENDER_SIMD_CUBIC_INL_H_
#endif

#include <algorithm>
#include <cstring>

#include <hwy/highway.h>

#include "render/simd/band_data.h"
#include "render/simd/gather-inl.h"
#include "render/simd/samples-inl.h"

HWY_BEFORE_NAMESPACE();
namespace lf::simd::HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

inline constexpr int kTaps = 4;  // taps along each axis

// Weights of the taps at t, 32768 = 1, two to 32 bits: across, first and third, second and fourth; down, twice the
// same.
struct CubicWeights {
  alignas(64) int16_t outer[2 * kBlock], inner[2 * kBlock], down[kTaps][2 * kBlock];
};

// Catmull-Rom's weights, from a = t (1 - t)^2 and b = t^2 (1 - t): -a/2, 1 - t + a - b/2, t + b - a/2, -b/2. They sum
// to 32767.
HWY_INLINE void cubic_weights(V16 t, V16& w0, V16& w1, V16& w2, V16& w3) {
  const D16 d;
  const auto rest = hn::Sub(hn::Set(d, 32767), t), both = hn::MulFixedPoint15(t, rest);
  const auto a = hn::MulFixedPoint15(both, rest), b = hn::MulFixedPoint15(both, t);
  const auto half_a = hn::ShiftRight<1>(a), half_b = hn::ShiftRight<1>(b);
  w0 = hn::Neg(half_a);
  w1 = hn::Add(rest, hn::Sub(hn::Add(half_a, half_a), half_b));
  w2 = hn::Add(t, hn::Sub(hn::Add(half_b, half_b), half_a));
  w3 = hn::Neg(half_b);
}

HWY_INLINE void find_weights(const Positions& at, CubicWeights& out) {
  const D16 d;
  for (size_t lane = 0; lane < kBlock; lane += hn::Lanes(d)) {
    V16 w[kTaps];
    cubic_weights(hn::Load(d, at.fx + lane), w[0], w[1], w[2], w[3]);
    hn::StoreInterleaved2(w[0], w[2], d, out.outer + 2 * lane);
    hn::StoreInterleaved2(w[1], w[3], d, out.inner + 2 * lane);
    cubic_weights(hn::Load(d, at.fy + lane), w[0], w[1], w[2], w[3]);
    for (int k = 0; k < kTaps; k++) hn::StoreInterleaved2(w[k], w[k], d, out.down[k] + 2 * lane);
  }
}

// Samples, times 128 and clamped to 0..255, from four rows of four bytes each, as many as a vector has 32-bit lanes.
// Weights as in CubicWeights.
template <class VU32>
HWY_INLINE auto cubic_samples(const VU32 rows[kTaps], V16 outer, V16 inner, const V16 down[kTaps]) {
  const D16 d;
  const hn::DFromV<VU32> du32;
  // Sums are in 64ths of a level, so that |sums| < 1.25 * 1.25 * 255 * 64 fits.
  auto first_third = hn::Zero(d), second_fourth = hn::Zero(d);
  for (int k = 0; k < kTaps; k++) {
    const auto even = hn::ShiftLeft<6>(hn::And(rows[k], hn::Set(du32, 0x00ff00ff)));
    const auto odd = hn::And(hn::ShiftRight<2>(rows[k]), hn::Set(du32, 0x3fc03fc0));
    first_third = hn::Add(first_third, hn::MulFixedPoint15(hn::BitCast(d, even), down[k]));
    second_fourth = hn::Add(second_fourth, hn::MulFixedPoint15(hn::BitCast(d, odd), down[k]));
  }
  const auto pairs = hn::Add(hn::MulFixedPoint15(first_third, outer), hn::MulFixedPoint15(second_fourth, inner));
  const auto sum = hn::Add(pairs, hn::BitCast(d, hn::ShiftRight<16>(hn::BitCast(du32, pairs))));
  const auto level = hn::Min(hn::Max(sum, hn::Zero(d)), hn::Set(d, 255 << 6));
  const hn::Rebind<uint16_t, decltype(du32)> to;
  return hn::BitCast(hn::RebindToSigned<decltype(to)>(),
                     hn::TruncateTo(to, hn::BitCast(du32, hn::ShiftLeft<kSumFractionBits - 6>(level))));
}

// As sample_windows(), for cubic samples of which nothing is cut off. kTall: on as many rows as it takes. `low`, `high`
// are a row above the windows and a column before them.
template <bool kTall>
HWY_INLINE VU16 sample_cubic_windows(VU16 x, V16 y, const uint8_t* low, const uint8_t* high, ptrdiff_t stride,
                                     size_t lane) {
  const D16 d;
  const DU16 du;
  const hn::Repartition<uint8_t, D16> d8;
  constexpr int kTo15 = 15 - kPositionBits;
  const auto fraction = [&](V16 v)
                            HWY_ATTR { return hn::ShiftLeft<kTo15>(hn::And(v, hn::Set(d, (1 << kPositionBits) - 1))); };
  V16 across[kTaps], down[kTaps];
  cubic_weights(fraction(hn::BitCast(d, x)), across[0], across[1], across[2], across[3]);
  cubic_weights(fraction(y), down[0], down[1], down[2], down[3]);
  const auto index = hn::ShiftRight<kPositionBits>(x);
  const auto both = hn::Or(index, hn::ShiftLeft<8>(index));
  const auto pick_outer = hn::BitCast(d8, hn::Add(both, hn::Set(du, 0x0100))),
             pick_inner = hn::BitCast(d8, hn::Add(both, hn::Set(du, 0x0302)));
  // Each half of a row has two taps, as the bytes of 16 bits.
  struct Row {
    VU16 left, right;
  };
  const auto load = [&](ptrdiff_t r) HWY_ATTR {
    const auto window = load_windows(low + r * stride, high + r * stride, lane);
    return Row{hn::BitCast(du, hn::TableLookupBytes(window, pick_outer)),
               hn::BitCast(du, hn::TableLookupBytes(window, pick_inner))};
  };
  // Sums are in 64ths of a level, as in cubic_samples(). Every second sum has a 256th of the one before it besides: the
  // bytes below its own are not taken out.
  V16 sum[kTaps] = {hn::Zero(d), hn::Zero(d), hn::Zero(d), hn::Zero(d)};
  if constexpr (kTall) {
    const auto row = hn::ShiftRight<kPositionBits>(hn::BitCast(du, y));
    const int rows = hn::GetLane(hn::MaxOfLanes(du, row)) + kTaps;
    V16 above[kTaps - 1] = {hn::Zero(d), hn::Zero(d), hn::Zero(d)};  // weights, by how many rows above the first tap is
    for (int r = 0; r < rows; r++) {
      const auto here = hn::RebindMask(d, hn::Eq(row, hn::Set(du, static_cast<uint16_t>(r))));
      const auto weight = hn::IfThenElse(here, down[0], above[0]);
      above[0] = hn::IfThenElse(here, down[1], above[1]);
      above[1] = hn::IfThenElse(here, down[2], above[2]);
      above[2] = hn::IfThenElseZero(here, down[3]);
      const auto add = [&](VU16 taps, V16& even, V16& odd) HWY_ATTR {
        const auto low_byte = hn::ShiftRight<2>(hn::ShiftLeft<8>(taps));
        even = hn::Add(even, hn::MulFixedPoint15(hn::BitCast(d, low_byte), weight));
        odd = hn::Add(odd, hn::MulFixedPoint15(hn::BitCast(d, hn::ShiftRight<2>(taps)), weight));
      };
      const Row taps = load(r);
      add(taps.left, sum[0], sum[1]);
      add(taps.right, sum[2], sum[3]);
    }
  } else {
    const auto next = hn::RebindMask(du, hn::Gt(y, hn::Set(d, (1 << kPositionBits) - 1)));
    // 16384 = 1, so that products of 256 times the levels are 64ths; those of the outer taps are taken off.
    VU16 weight[kTaps] = {hn::BitCast(du, hn::ShiftRight<1>(hn::Neg(down[0]))), hn::Zero(du),
                          hn::BitCast(du, hn::ShiftRight<1>(down[2])),
                          hn::BitCast(du, hn::ShiftRight<1>(hn::Neg(down[3])))};
    weight[1] = hn::Sub(hn::Add(hn::Add(weight[0], weight[3]), hn::Set(du, 1 << 14)), weight[2]);
    Row upper = load(0);
    for (int k = 0; k < kTaps; k++) {
      const Row lower = load(k + 1);
      const auto add = [&](VU16 taps, V16& even, V16& odd) HWY_ATTR {
        const auto add_to = [&](V16& to, VU16 v) HWY_ATTR {
          const auto product = hn::BitCast(d, hn::MulHigh(v, weight[k]));
          to = k == 0 || k == 3 ? hn::Sub(to, product) : hn::Add(to, product);
        };
        add_to(even, hn::ShiftLeft<8>(taps));
        add_to(odd, taps);
      };
      add(hn::IfThenElse(next, lower.left, upper.left), sum[0], sum[1]);
      add(hn::IfThenElse(next, lower.right, upper.right), sum[2], sum[3]);
      upper = lower;
    }
  }
  for (int k = 1; k < kTaps; k += 2) sum[k] = hn::Sub(sum[k], hn::ShiftRight<8>(sum[k - 1]));
  auto all = hn::MulFixedPoint15(sum[0], across[0]);
  for (int k = 1; k < kTaps; k++) all = hn::Add(all, hn::MulFixedPoint15(sum[k], across[k]));
  const auto level = hn::Min(hn::Max(all, hn::Zero(d)), hn::Set(d, 255 << 6));
  return hn::BitCast(du, hn::ShiftLeft<2>(level));
}

// A plane of pixels, or of samples.
struct CubicPlane {
  const uint8_t* base;
  ptrdiff_t stride;
  int width, height, pixel_stride;
};

// The places of a half's samples in a plane: positions count from its window's corner.
struct CubicPlaces {
  CubicPlaces(const Positions& at, int half, const CubicPlane& plane)
      : y0(at.corner[half] / static_cast<int32_t>(plane.stride)),
        x0((at.corner[half] - y0 * static_cast<int32_t>(plane.stride)) / plane.pixel_stride) {}
  int y0, x0;
};

// Four rows of kBytes from the taps of each sample of a half. kBytes may be more than four taps have: then they are
// read only where there are as many. to(k, i): where row k of sample i goes.
template <int kBytes, class To>
HWY_INLINE void copy_taps(const Positions& at, int half, const CubicPlane& plane, const To& to) {
  const hn::CappedTag<int32_t, kHalf> d;
  const CubicPlaces places(at, half, plane);
  alignas(32) int32_t offset[kHalf];
  auto outside = hn::Lt(hn::Zero(d), hn::Zero(d));
  // The last row is left to the slow way if there could be too few bytes after the taps.
  const int below = kBytes > kTaps * plane.pixel_stride ? 3 : 2;
  for (int i = 0; i < kHalf; i += static_cast<int>(hn::Lanes(d))) {
    const auto x = hn::Add(hn::Load(d, at.column + half * kHalf + i), hn::Set(d, places.x0 - 1));
    const auto y = hn::Add(hn::Load(d, at.row + half * kHalf + i), hn::Set(d, places.y0 - 1));
    hn::Store(
        hn::Add(hn::Mul(y, hn::Set(d, static_cast<int32_t>(plane.stride))), hn::Mul(x, hn::Set(d, plane.pixel_stride))),
        d, offset + i);
    const auto out_across = hn::Or(hn::Lt(x, hn::Zero(d)), hn::Gt(x, hn::Set(d, plane.width - kTaps)));
    const auto out_down = hn::Or(hn::Lt(y, hn::Zero(d)), hn::Gt(y, hn::Set(d, plane.height - 2 - below)));
    outside = hn::Or(outside, hn::Or(out_across, out_down));
  }
  if (HWY_LIKELY(hn::AllFalse(d, outside))) {
    const ptrdiff_t stride = plane.stride;
    for (int i = 0; i < kHalf; i++) {
      const uint8_t* const from = plane.base + offset[i];
      for (int k = 0; k < kTaps; k++) std::memcpy(to(k, i), from + k * stride, kBytes);
    }
    return;
  }
  for (int i = 0; i < kHalf; i++) {
    const int x = places.x0 + at.column[half * kHalf + i] - 1, y = places.y0 + at.row[half * kHalf + i] - 1;
    if (x >= 0 && x <= plane.width - kTaps && y >= 0 && y <= plane.height - 2 - below) {
      for (int k = 0; k < kTaps; k++) std::memcpy(to(k, i), plane.base + offset[i] + k * plane.stride, kBytes);
      continue;
    }
    for (int k = 0; k < kTaps; k++) {
      const uint8_t* const row = plane.base + std::clamp(y + k, 0, plane.height - 1) * plane.stride;
      for (int tap = 0; tap < kTaps; tap++) {
        const int column = std::clamp(x + tap, 0, plane.width - 1);
        if constexpr (kBytes == kTaps)
          to(k, i)[tap] = row[column];
        else
          std::memcpy(to(k, i) + tap * plane.pixel_stride, row + column * plane.pixel_stride, plane.pixel_stride);
      }
    }
  }
}

// Cubic samples as gather_bytes() has bilinear ones: the halves may be of two planes.
inline void gather_cubic_bytes(const Positions& at, const CubicPlane& low, const CubicPlane& high, int16_t* out) {
  alignas(64) uint32_t rows[kTaps][kBlock];
  CubicWeights weights;
  find_weights(at, weights);
  for (int half = 0; half < 2; half++)
    copy_taps<4>(at, half, half ? high : low,
                 [&](int k, int i) { return reinterpret_cast<uint8_t*>(&rows[k][half * kHalf + i]); });
  const D16 d;
  const hn::Repartition<uint32_t, D16> du32;
  const hn::Rebind<int16_t, decltype(du32)> d_out;
  for (size_t i = 0; i < kBlock; i += hn::Lanes(du32)) {
    const hn::Vec<decltype(du32)> taps[kTaps] = {hn::Load(du32, rows[0] + i), hn::Load(du32, rows[1] + i),
                                                 hn::Load(du32, rows[2] + i), hn::Load(du32, rows[3] + i)};
    const V16 down[kTaps] = {hn::Load(d, weights.down[0] + 2 * i), hn::Load(d, weights.down[1] + 2 * i),
                             hn::Load(d, weights.down[2] + 2 * i), hn::Load(d, weights.down[3] + 2 * i)};
    const auto samples =
        cubic_samples(taps, hn::Load(d, weights.outer + 2 * i), hn::Load(d, weights.inner + 2 * i), down);
    hn::StoreU(samples, d_out, out + i);
  }
}

// Cubic samples as gather_pixels() has bilinear ones.
inline void gather_cubic_pixels(const Positions& at, const Slot& slot, int16_t out[3][kBlock]) {
  const ImageView& image = slot.image;
  const CubicPlane plane{image.plane[0], image.stride[0], image.width, image.height, image.layout.pixel_stride};
  // A sample's row: four taps of R, of G, of B, of nothing.
  alignas(64) uint8_t rows[kTaps][kBlock][16];
  CubicWeights weights;
  find_weights(at, weights);
  const hn::Repartition<uint8_t, D16> d8;
  const auto pick = hn::LoadDup128(d8, slot.pixel_taps);
  for (int half = 0; half < 2; half++)
    copy_taps<16>(at, half, plane, [&](int k, int i) { return rows[k][half * kHalf + i]; });
  const D16 d;
  const hn::Repartition<uint32_t, D16> du32;
  const hn::Rebind<int16_t, decltype(du32)> d_out;
  alignas(64) int16_t mixed[4 * kBlock];
  const size_t pixels = hn::Lanes(du32) / 4;  // pixels of four values in a vector
  for (size_t i = 0; i < kBlock; i += pixels) {
    // Each pixel's weights for its four lanes.
    const auto spread = [&](const int16_t* from) HWY_ATTR {
      uint32_t pair[2];
      std::memcpy(pair, from + 2 * i, pixels * sizeof(uint32_t));
      auto v = hn::Set(du32, pair[0]);
      if constexpr (hn::MaxLanes(D16()) == kBlock) v = hn::ConcatUpperLower(du32, hn::Set(du32, pair[1]), v);
      return hn::BitCast(d, v);
    };
    const auto load = [&](int k)
                          HWY_ATTR { return hn::BitCast(du32, hn::TableLookupBytes(hn::Load(d8, rows[k][i]), pick)); };
    const hn::Vec<decltype(du32)> taps[kTaps] = {load(0), load(1), load(2), load(3)};
    const V16 down[kTaps] = {spread(weights.down[0]), spread(weights.down[1]), spread(weights.down[2]),
                             spread(weights.down[3])};
    const auto samples = cubic_samples(taps, spread(weights.outer), spread(weights.inner), down);
    hn::StoreU(samples, d_out, mixed + 4 * i);
  }
  part_colours(mixed, out);
}

}  // namespace lf::simd::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();
#endif
