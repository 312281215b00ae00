// SPDX-License-Identifier: LGPL-2.1-or-later
// Per target, see render_band.cc: bilinear samples of one plane and row of a block, from windows of its rows.
#if defined(LF_RENDER_SIMD_SAMPLES_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef LF_RENDER_SIMD_SAMPLES_INL_H_
#undef LF_RENDER_SIMD_SAMPLES_INL_H_
#else
#define LF_RENDER_SIMD_SAMPLES_INL_H_
#endif

#include <hwy/highway.h>

#include "render/simd/band_data.h"
#include "render/simd/positions-inl.h"

HWY_BEFORE_NAMESPACE();
namespace lf::simd::HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

using D16 = hn::CappedTag<int16_t, kBlock>;
using V16 = hn::Vec<D16>;
using DU16 = hn::RebindToUnsigned<D16>;

// a + (b - a) f, f in 0..1 as 15-bit fraction; a and b are levels times 128, so differences fit.
HWY_INLINE V16 mix(V16 a, V16 b, V16 f) { return hn::Add(a, hn::MulFixedPoint15(hn::Sub(b, a), f)); }

// Tells where the 16 samples of a unit are along its block: t, and Bessel's weight of it, in fixed point.
struct UnitTable {
  alignas(64) uint16_t t16[kBlock];  // 65536 = 1
  alignas(64) int16_t t15[kBlock];   // 32768 = 1
  alignas(64) int16_t bessel15[kBlock];
  alignas(64) float x[kBlock];  // pixels from the block's left edge
};

constexpr UnitTable make_unit_table(bool chroma) {
  UnitTable table{};
  for (int i = 0; i < kBlock; i++) {
    const float x = chroma ? static_cast<float>(2 * (i % kChromaBlock)) + 0.5f : static_cast<float>(i), t = x / kBlock;
    table.t16[i] = static_cast<uint16_t>(t * 65536);
    table.t15[i] = static_cast<int16_t>(t * 32768);
    table.bessel15[i] = static_cast<int16_t>(bessel(t) * 32768 - 0.5f);  // never positive
    table.x[i] = x;
  }
  return table;
}
inline constexpr UnitTable kLumaTable = make_unit_table(false), kChromaTable = make_unit_table(true);

// Loads 16 bytes for each half of a vector of 16 samples; for shorter vectors those of the half that they are in.
HWY_INLINE auto load_windows(const uint8_t* low, const uint8_t* high, size_t lane) {
  const hn::Repartition<uint8_t, D16> d8;
  if constexpr (hn::MaxLanes(D16()) == kBlock) {
    const hn::Half<decltype(d8)> half;
    return hn::Combine(d8, hn::LoadU(half, high), hn::LoadU(half, low));
  } else {
    return hn::LoadU(d8, lane < kChromaBlock ? low : high);
  }
}

// A vector with one value for the samples of a block's first half and another for those of its second.
HWY_INLINE auto by_half(uint16_t low, uint16_t high, size_t lane) {
  const DU16 d;
  if constexpr (hn::MaxLanes(D16()) == kBlock)
    return hn::ConcatUpperLower(d, hn::Set(d, high), hn::Set(d, low));
  else
    return hn::Set(d, lane < kChromaBlock ? low : high);
}

using VU16 = hn::Vec<DU16>;

// a (1 - f) + b f of 16-bit values, f in 0..1 as 16-bit fraction and `rest` its complement.
HWY_INLINE VU16 blend(VU16 a, VU16 b, VU16 rest, VU16 f) { return hn::Add(hn::MulHigh(a, rest), hn::MulHigh(b, f)); }

// What sample_windows() cuts off from its products, on average: from nothing to twice as much.
inline constexpr int kCutOff = 3;

// On how many rows of their windows samples may begin: the first two, or more where a focal surface steps.
inline constexpr int kFlatSteps = 2, kTallSteps = 7, kTallChromaSteps = 4;

// Samples lane.. of a block whose windows hold all that is needed, times 256, and kCutOff too small. `low`, `high`:
// where the windows of its two halves begin.
// `x`, `y`: positions in the windows, in fixed point (kPositionBits).
template <int kSteps>
HWY_INLINE VU16 sample_windows(VU16 x, V16 y, const uint8_t* low, const uint8_t* high, ptrdiff_t stride, size_t lane) {
  const D16 d;
  const DU16 du;
  const hn::Repartition<uint8_t, D16> d8;
  constexpr int kToFraction16 = 16 - kPositionBits;
  const auto fx = hn::ShiftLeft<kToFraction16>(x), fy = hn::BitCast(du, hn::ShiftLeft<kToFraction16>(y));
  const auto rest_x = hn::Not(fx), rest_y = hn::Not(fy);
  // Bytes of a 16-bit lane: a sample and its right neighbour.
  const auto index = hn::ShiftRight<kPositionBits>(x);
  const auto pick = hn::BitCast(d8, hn::Add(hn::Or(index, hn::ShiftLeft<8>(index)), hn::Set(du, 0x0100)));
  const auto pairs = [&](ptrdiff_t row) HWY_ATTR {
    return hn::BitCast(du, hn::TableLookupBytes(load_windows(low + row * stride, high + row * stride, lane), pick));
  };
  // Reading all rows always is faster than asking.
  auto upper = pairs(0), lower = pairs(1), last = lower;
  HWY_UNROLL(kTallSteps)
  for (int r = 1; r < kSteps; r++) {
    const auto below = hn::RebindMask(du, hn::Gt(y, hn::Set(d, static_cast<int16_t>((r << kPositionBits) - 1))));
    const auto next = pairs(r + 1);
    upper = hn::IfThenElse(below, last, upper);
    lower = hn::IfThenElse(below, next, lower);
    last = next;
  }
  const auto across = [&](VU16 pair) HWY_ATTR {
    return blend(hn::ShiftLeft<8>(pair), hn::And(pair, hn::Set(du, 0xff00)), rest_x, fx);
  };
  return blend(across(upper), across(lower), rest_y, fy);
}

// Positions in windows, in fixed point (kPositionBits).
struct FixedPositions {
  V16 x, y;
};

// Interpolates the positions of a block's samples on a plane.
HWY_INLINE FixedPositions plane_between(const WindowPositions& at, const UnitTable& table, size_t lane) {
  const D16 d;
  const DU16 du;
  const auto bend = hn::Load(d, table.bessel15 + lane);
  const auto along = hn::Add(hn::MulHigh(hn::Set(du, at.dx), hn::Load(du, table.t16 + lane)),
                             hn::BitCast(du, hn::MulFixedPoint15(hn::Set(d, at.sx), bend)));
  const auto x = hn::Add(by_half(at.x0, at.x0_half, lane), along);  // x in each half's window
  const auto y = hn::Add(hn::Add(hn::Set(d, at.y0), hn::MulFixedPoint15(hn::Set(d, at.sy), bend)),
                         hn::MulFixedPoint15(hn::Set(d, at.dy), hn::Load(d, table.t15 + lane)));
  return {hn::BitCast(d, x), y};
}

}  // namespace lf::simd::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();
#endif
