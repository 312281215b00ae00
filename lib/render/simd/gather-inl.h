// SPDX-License-Identifier: LGPL-2.1-or-later
// Per target, see render_band.cc: positions of the samples of a block, one by one, and bilinear samples from there.
#if defined(LF_RENDER_SIMD_GATHER_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef LF_RENDER_SIMD_GATHER_INL_H_
#undef LF_RENDER_SIMD_GATHER_INL_H_
#else
#define LF_RENDER_SIMD_GATHER_INL_H_
#endif

#include <algorithm>
#include <cstring>

#include <hwy/highway.h>

#include "render/simd/band_data.h"
#include "render/simd/positions-inl.h"
#include "render/simd/samples-inl.h"

HWY_BEFORE_NAMESPACE();
namespace lf::simd::HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

// Positions of all samples of a block, as whole part and 15-bit fraction: in the plane's own coordinates, or each half
// in its window.
struct Positions {
  alignas(64) int32_t column[kBlock], row[kBlock];
  alignas(64) int16_t fx[kBlock], fy[kBlock];
  int32_t corner[2] = {};  // byte offsets of the halves' windows in the plane
};

// Splits positions into whole part and fraction. `largest`: of the whole part, so that there is a neighbour.
template <class D, class V = hn::Vec<D>>
HWY_INLINE void split(D d, V v, V largest, int32_t* whole, int16_t* fraction) {
  const hn::RebindToSigned<D> di;
  const hn::Rebind<int16_t, D> d16;
  const auto floor = hn::Min(hn::Floor(v), largest);
  hn::Store(hn::ConvertTo(di, floor), di, whole);
  const auto f = hn::Min(hn::Mul(hn::Sub(v, floor), hn::Set(d, 32768.f)), hn::Set(d, 32767.f));
  hn::Store(hn::BitCast(d16, to_fixed(d16, f)), d16, fraction);
}

// Interpolates the positions of entry `i` of a plane.
inline void interpolate_positions(const PlanePositions& at, int i, const UnitTable& table, Positions& out) {
  const hn::CappedTag<float, kBlock> d;
  const auto along = [&](const std::vector<float>& node, size_t lane) HWY_ATTR {
    const float *n = node.data() + i, delta = n[2] - n[1], second = (n[3] - n[2]) - (n[1] - n[0]);
    const auto t = hn::Mul(hn::Load(d, table.x + lane), hn::Set(d, 1.f / kBlock));
    const auto b = hn::Mul(hn::Mul(t, hn::Sub(t, hn::Set(d, 1.f))), hn::Set(d, 0.25f * second));
    return hn::Add(hn::MulAdd(t, hn::Set(d, delta), hn::Set(d, n[1])), b);
  };
  for (size_t lane = 0; lane < kBlock; lane += hn::Lanes(d)) {
    split(d, along(at.node_x, lane), hn::Set(d, 1e9f), out.column + lane, out.fx + lane);
    split(d, along(at.node_y, lane), hn::Set(d, 1e9f), out.row + lane, out.fy + lane);
  }
}

// Whether the samples at projected positions are seen: all, some, or rounding decides.
enum class Sight { kAll, kSome, kDoubtful };

// Positions that are projected one by one, for chroma or another plane, clamped to the image. `x`, `y`: from where
// `terms` are to the block's left edge and to the samples' row. Lanes with `weight` that are lost have it moved to
// `lost` (both of kBlock values; null for chroma, which is where its pixels are). `inverse`: distances of the focal
// map, of kBlock values, those of chroma twice over; null without one. Doubtful: rounding could decide on a sample, or
// its bytes can't be read; nothing is changed then.
inline Sight project_positions(const SumTask& task, const Slot& slot, const ProjectionTerms& terms, bool chroma,
                               float x, float y, const UnitTable& table, const float* inverse, int16_t* weight,
                               int16_t* lost, Positions& out) {
  const hn::CappedTag<float, kBlock> d;
  const hn::RebindToSigned<decltype(d)> di;
  const hn::Rebind<int16_t, decltype(d)> d16;
  const Projection projection(slot, terms);
  const float width = static_cast<float>(chroma ? chroma_size(slot.image.width) : slot.image.width);
  const float height = static_cast<float>(chroma ? chroma_size(slot.image.height) : slot.image.height);
  if (width < 2 || height < 2) return Sight::kDoubtful;
  const auto set = [&](float v) HWY_ATTR { return hn::Set(d, v); };
  constexpr float kDoubt = 1.f / 128;  // pixels; far above the rounding of float
  bool doubtful = false, all = true;
  alignas(64) int16_t seen_weight[kBlock] = {}, lost_weight[kBlock] = {};
  for (size_t lane = 0; lane < kBlock; lane += hn::Lanes(d)) {
    hn::Vec<decltype(d)> px, py, z, r2;
    const auto column = hn::Add(hn::Load(d, table.x + lane), set(x)), row = set(y);
    if (inverse)
      projection.project(d, column, row, hn::LoadU(d, inverse + lane), px, py, z, r2);
    else
      projection.project(d, column, row, px, py, z, r2);
    const auto in_front = hn::And(hn::Gt(z, hn::Zero(d)), hn::Le(r2, set(slot.max_r2)));
    if (weight) {
      // How far inside the image's domain: negative outside.
      const auto depth = hn::Min(hn::Min(hn::Add(px, set(0.5f)), hn::Sub(set(width - 0.5f), px)),
                                 hn::Min(hn::Add(py, set(0.5f)), hn::Sub(set(height - 0.5f), py)));
      const auto w = hn::PromoteTo(di, hn::Load(d16, weight + lane));
      const auto weighs = hn::RebindMask(d, hn::Gt(w, hn::Zero(di)));
      const auto seen = hn::And(in_front, hn::Gt(depth, hn::Zero(d)));
      // Near the eye's plane, the fold and the border: let doubles decide.
      const auto to_fold = hn::Abs(hn::Sub(r2, set(slot.max_r2)));
      const auto clear =
          hn::And(hn::Gt(hn::Abs(depth), set(kDoubt)),
                  hn::And(hn::Gt(hn::Abs(z), set(1e-3f)), hn::Gt(to_fold, set(1e-3f * std::min(slot.max_r2, 1e3f)))));
      doubtful = doubtful || !hn::AllFalse(d, hn::AndNot(clear, weighs));
      const auto w_seen = hn::IfThenElseZero(hn::RebindMask(di, seen), w);
      hn::Store(hn::DemoteTo(d16, w_seen), d16, seen_weight + lane);
      hn::Store(hn::DemoteTo(d16, hn::Sub(w, w_seen)), d16, lost_weight + lane);
      all = all && hn::AllFalse(d, hn::AndNot(seen, weighs));
    } else {
      px = hn::Mul(hn::Sub(px, set(0.5f)), set(0.5f));
      py = hn::Mul(hn::Sub(py, set(0.5f)), set(0.5f));
      // A chroma sample may lie behind the camera and some of its pixels in front of it.
      doubtful = doubtful || !hn::AllTrue(d, in_front);
    }
    // What is not in front has no weight, and any position is good.
    const auto good = hn::And(in_front, hn::And(hn::Eq(px, px), hn::Eq(py, py)));
    const auto limited = [&](const auto v, float largest) HWY_ATTR {
      return hn::IfThenElseZero(good, hn::Max(hn::Min(v, set(largest)), hn::Zero(d)));
    };
    split(d, limited(px, width - 1), set(width - 2), out.column + lane, out.fx + lane);
    split(d, limited(py, height - 1), set(height - 2), out.row + lane, out.fy + lane);
  }
  // The bytes after the last pixel of three bytes are not ours.
  if (task.family == PixelFamily::kRgb && slot.image.layout.pixel_stride < 4)
    for (int i = 0; i < kBlock; i++)
      doubtful = doubtful || (out.row[i] + 2 >= slot.image.height && out.column[i] + 2 >= slot.image.width);
  if (doubtful) return Sight::kDoubtful;
  if (weight && !all) {
    std::copy_n(seen_weight, kBlock, weight);
    std::copy_n(lost_weight, kBlock, lost);
  }
  return all ? Sight::kAll : Sight::kSome;
}

// Samples from anywhere inside the planes of the two halves, times 128.
HWY_INLINE void gather_bytes(const Positions& at, const uint8_t* low, const uint8_t* high, ptrdiff_t low_stride,
                             ptrdiff_t high_stride, int16_t* out) {
  alignas(64) uint16_t upper[kBlock], lower[kBlock];
  for (int i = 0; i < kBlock; i++) {
    const ptrdiff_t stride = i < kChromaBlock ? low_stride : high_stride;
    const uint8_t* from = (i < kHalf ? low + at.corner[0] : high + at.corner[1]) + at.row[i] * stride + at.column[i];
    std::memcpy(&upper[i], from, 2);
    std::memcpy(&lower[i], from + stride, 2);
  }
  const D16 d;
  const DU16 du;
  for (size_t lane = 0; lane < kBlock; lane += hn::Lanes(d)) {
    const auto fx = hn::Load(d, at.fx + lane), fy = hn::Load(d, at.fy + lane);
    const auto across = [&](const uint16_t* pairs) HWY_ATTR {
      const auto v = hn::Load(du, pairs + lane);
      return mix(hn::BitCast(d, hn::ShiftRight<1>(hn::ShiftLeft<8>(v))),
                 hn::BitCast(d, hn::And(hn::ShiftRight<1>(v), hn::Set(du, 0x7f80))), fx);
    };
    hn::Store(mix(across(upper), across(lower), fy), d, out + lane);
  }
}

// Planes of R, G and B from pixels of four values.
HWY_INLINE void part_colours(const int16_t* pixels, int16_t out[3][kBlock]) {
  const D16 d;
  for (size_t i = 0; i < kBlock; i += hn::Lanes(d)) {
    V16 r, g, b, rest;
    hn::LoadInterleaved4(d, pixels + 4 * i, r, g, b, rest);
    hn::Store(r, d, out[0] + i);
    hn::Store(g, d, out[1] + i);
    hn::Store(b, d, out[2] + i);
  }
}

// Samples of R, G and B, times 128, from anywhere inside the image.
HWY_INLINE void gather_pixels(const Positions& at, const Slot& slot, int16_t out[3][kBlock]) {
  const uint8_t* const plane = slot.image.plane[0];
  const ptrdiff_t stride = slot.image.stride[0], pixel_stride = slot.image.layout.pixel_stride;
  alignas(64) uint64_t upper[kBlock], lower[kBlock], fx[kBlock], fy[kBlock];
  constexpr uint64_t kSpread = 0x0001000100010001;
  for (int i = 0; i < kBlock; i++) {
    const uint8_t* from = plane + at.corner[i / kHalf] + at.row[i] * stride + at.column[i] * pixel_stride;
    std::memcpy(&upper[i], from, 8);
    std::memcpy(&lower[i], from + stride, 8);
    fx[i] = static_cast<uint16_t>(at.fx[i]) * kSpread;
    fy[i] = static_cast<uint16_t>(at.fy[i]) * kSpread;
  }
  const D16 d;
  const DU16 du;
  const hn::Repartition<uint8_t, D16> d8;
  const hn::Repartition<uint64_t, D16> d64;
  const auto bytes = hn::LoadDup128(d8, slot.pixel_pairs);
  alignas(64) int16_t mixed[4 * kBlock];
  for (size_t i = 0; i < kBlock; i += hn::Lanes(d64)) {
    const auto x = hn::BitCast(d, hn::Load(d64, fx + i)), y = hn::BitCast(d, hn::Load(d64, fy + i));
    const auto across = [&](const uint64_t* pairs) HWY_ATTR {
      const auto v = hn::BitCast(du, hn::TableLookupBytesOr0(hn::BitCast(d8, hn::Load(d64, pairs + i)), bytes));
      return mix(hn::BitCast(d, hn::ShiftRight<1>(hn::ShiftLeft<8>(v))),
                 hn::BitCast(d, hn::And(hn::ShiftRight<1>(v), hn::Set(du, 0x7f80))), x);
    };
    hn::Store(mix(across(upper), across(lower), y), d, mixed + 4 * i);
  }
  part_colours(mixed, out);
}

}  // namespace lf::simd::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();
#endif
