// SPDX-License-Identifier: LGPL-2.1-or-later
// Per target, see render_band.cc: a band between the nodes of a focal map, in one camera's image, and the windows that
// its samples are fetched from.
#if defined(LF_RENDER_SIMD_SURFACE_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef LF_RENDER_SIMD_SURFACE_INL_H_
#undef LF_RENDER_SIMD_SURFACE_INL_H_
#else
#define LF_RENDER_SIMD_SURFACE_INL_H_
#endif

#include <algorithm>
#include <type_traits>
#include <vector>

#include <hwy/highway.h>

#include "render/simd/band_data.h"
#include "render/simd/cells-inl.h"
#if HWY_TARGET != HWY_SCALAR
#include "render/simd/fixed_cells-inl.h"
#include "render/simd/positions-inl.h"
#include "render/simd/samples-inl.h"
#endif

HWY_BEFORE_NAMESPACE();
namespace lf::simd::HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

#if HWY_TARGET != HWY_SCALAR

// The larger or smaller of the halves of each block, for both of them.
template <class V>
HWY_INLINE V least_of_block(V v) {
  return hn::Min(v, hn::Shuffle2301(v));
}
template <class V>
HWY_INLINE V most_of_block(V v) {
  return hn::Max(v, hn::Shuffle2301(v));
}

// Ways in which samples may be fetched; what all planes and halves of a block have in common decides. Flat windows may
// be too near the image's end for tall ones.
enum FetchBits : int32_t { kSampleBit = 1, kTallBit = 2, kFlatBit = 4 };

// Bounds the samples of a pair of rows in an image, or of its one row in a plane of chroma. NaN fails every comparison.
template <class D, class V = hn::Vec<D>>
struct CellPlace {
  V low_x, high_x, low_y, high_y;
  V column, width;     // columns of windows, and how far their samples reach
  V last_row, height;  // first row of the lower row's windows; rows that samples reach over, the larger number of both
  HWY_INLINE auto is_outside(D d, const PlaneGeometry& plane) const {
    return hn::Or(hn::Or(hn::Lt(high_x, hn::Set(d, -0.5f)), hn::Gt(low_x, hn::Set(d, plane.width - 0.5f))),
                  hn::Or(hn::Lt(high_y, hn::Set(d, -0.5f)), hn::Gt(low_y, hn::Set(d, plane.height - 0.5f))));
  }
  // The FetchBits that are good here. `widest`: where fixed point ends across; `tall`: the most rows that samples may
  // begin on in tall windows.
  HWY_INLINE auto fetch(D d, const PlaneGeometry& plane, float widest, float tall) const {
    const hn::RebindToSigned<D> di;
    const auto set = [d](float v) HWY_ATTR { return hn::Set(d, v); };
    const auto inside =
        hn::And(hn::And(hn::Ge(low_x, set(0)), hn::Lt(high_x, set(plane.width - 1 - plane.spare_columns))),
                hn::And(hn::Ge(low_y, set(0)), hn::Lt(high_y, set(plane.height - 1))));
    const auto fits = hn::And(hn::Lt(width, set(widest)), hn::Lt(height, set(kWindow - 1)));
    const auto good = hn::And(inside, fits);
    const auto code = [&](hn::Mask<D> when, int v, auto otherwise)
                          HWY_ATTR { return hn::IfThenElse(hn::RebindMask(di, when), hn::Set(di, v), otherwise); };
    const auto out = code(good, kSampleBit, hn::Zero(di));
    if (!plane.shuffles) return out;
    const auto narrow = hn::And(good, hn::Lt(width, set(kWindow - 1)));
    // Windows run over into the next image row: it has to be there.
    const auto rows = [&](float n) HWY_ATTR {
      return hn::And(hn::Lt(height, set(n)), hn::Lt(last_row, set(plane.height - 1 - n)));
    };
    const auto flat = code(hn::And(narrow, rows(kFlatSteps)), kFlatBit, out);
    return hn::Or(flat, code(hn::And(narrow, rows(tall)), kTallBit, hn::Zero(di)));
  }
};

// Decides how the pairs of rows of each block are fetched, and from where: sets band.verdict, as decide() does.
inline void decide_cells(const Slot& slot, bool i420, SlotBand& band) {
  const hn::CappedTag<float, kBlock> d;
  const hn::RebindToSigned<decltype(d)> di;
  const hn::RebindToUnsigned<decltype(d)> du;
  const hn::Half<decltype(di)> d_blocks;
  using V = hn::Vec<decltype(d)>;
  using VI = hn::Vec<decltype(di)>;
  SurfaceBand& out = band.surface;
  const size_t halves = 2 * static_cast<size_t>(band.blocks), pitch = out.pitch;
  const PlaneGeometry luma = luma_geometry(slot, i420);
  const PlaneGeometry chroma = i420 ? chroma_geometry(slot) : luma;
  const auto set = [&](float v) HWY_ATTR { return hn::Set(d, v); };
  const auto store_blocks = [&](VI v, int32_t* to) HWY_ATTR {
    hn::StoreU(hn::LowerHalf(d_blocks, hn::ConcatEven(di, v, v)), d_blocks, to);
  };
  const auto corner = [&](const PlaneGeometry& plane, VI column, VI row) HWY_ATTR {
    return hn::Add(hn::Mul(row, hn::Set(di, plane.stride)), hn::Mul(column, hn::Set(di, plane.pixel_bytes)));
  };
  // Where a window begins, in fixed point: whole pixels and parts of 2^-kBits.
  const auto origin = [&](auto bits, VI column, VI row, uint32_t more) HWY_ATTR {
    constexpr int kBits = decltype(bits)::value;
    const auto x = hn::And(hn::ShiftLeft<kBits>(hn::BitCast(du, column)), hn::Set(du, 0xffff));
    return hn::Or(hn::Or(x, hn::ShiftLeft<16 + kBits>(hn::BitCast(du, row))), hn::Set(du, more));
  };
  const auto code = [&](int v) HWY_ATTR { return hn::Set(di, v); };
  for (size_t i = 0; i < halves; i += hn::Lanes(d)) {
    auto calm = hn::Zero(di);
    for (int pair = 0; pair < kBandPairs; pair++) {
      const int k = cell_of_pair(pair);
      const size_t upper = out.entry(k, i), lower = out.entry(k + 1, i);
      const auto slack_x = hn::LoadU(d, out.slack_x.data() + upper), slack_y = hn::LoadU(d, out.slack_y.data() + upper);
      struct Rows {
        V upper, lower;
      };
      const auto rows = [&](const std::vector<float>& of) HWY_ATTR {
        const auto from = hn::LoadU(d, of.data() + upper), step = hn::Sub(hn::LoadU(d, of.data() + lower), from);
        const auto at = hn::MulAdd(set(first_t(pair)), step, from);
        return Rows{at, hn::MulAdd(set(1.f / kCell), step, at)};
      };
      const Rows left = rows(out.low_x), right = rows(out.high_x);
      Rows top = rows(out.low_y), bottom = rows(out.high_y);
      top = {hn::Sub(top.upper, slack_y), hn::Sub(top.lower, slack_y)};
      bottom = {hn::Add(bottom.upper, slack_y), hn::Add(bottom.lower, slack_y)};
      CellPlace<decltype(d)> at;
      at.low_x = hn::Sub(hn::Min(left.upper, left.lower), slack_x);
      at.high_x = hn::Add(hn::Max(right.upper, right.lower), slack_x);
      at.low_y = hn::Min(top.upper, top.lower);
      at.high_y = hn::Max(bottom.upper, bottom.lower);
      const auto upper_row = hn::Floor(top.upper), lower_row = hn::Floor(top.lower);
      at.column = hn::Floor(at.low_x);
      at.width = hn::Sub(at.high_x, at.column);
      at.last_row = hn::Max(upper_row, lower_row);
      at.height = hn::Max(hn::Sub(bottom.upper, upper_row), hn::Sub(bottom.lower, lower_row));
      const auto lost = hn::IfThenElseZero(hn::RebindMask(di, at.is_outside(d, luma)), code(SlotBand::kAllLost));
      const auto lost_block = hn::And(lost, hn::Shuffle2301(lost));
      auto fetch = at.fetch(d, luma, 2 * kWindow - 1, kTallSteps);
      const size_t row = static_cast<size_t>(2 * pair) * pitch + i;
      const auto in_column = hn::ConvertTo(di, at.column), in_upper = hn::ConvertTo(di, upper_row),
                 in_lower = hn::ConvertTo(di, lower_row);
      hn::StoreU(corner(luma, in_column, in_upper), di, out.luma_corner.data() + row);
      hn::StoreU(corner(luma, in_column, in_lower), di, out.luma_corner.data() + row + pitch);
      constexpr std::integral_constant<int, kPositionBits> kLuma;
      hn::StoreU(origin(kLuma, in_column, in_upper, 0), du, out.luma_origin.data() + row);
      hn::StoreU(origin(kLuma, in_column, in_lower, 0), du, out.luma_origin.data() + row + pitch);
      if (i420) {
        // Chroma sample k is at luma 2 k + 0.5, within the bounds of both rows, and down in the middle of them.
        const auto to_chroma = [&](V v, float slack) HWY_ATTR { return hn::MulAdd(v, set(0.5f), set(slack - 0.25f)); };
        const auto middle = [&](const Rows& of) HWY_ATTR { return hn::Mul(set(0.5f), hn::Add(of.upper, of.lower)); };
        CellPlace<decltype(d)> in_chroma;
        in_chroma.low_x = to_chroma(least_of_block(at.low_x), -kSlack);
        in_chroma.high_x = to_chroma(most_of_block(at.high_x), kSlack);
        in_chroma.low_y = to_chroma(least_of_block(middle(top)), -kSlack);
        in_chroma.high_y = to_chroma(most_of_block(middle(bottom)), kSlack);
        in_chroma.column = hn::Floor(in_chroma.low_x);
        in_chroma.width = hn::Sub(in_chroma.high_x, in_chroma.column);
        in_chroma.last_row = hn::Floor(in_chroma.low_y);
        in_chroma.height = hn::Sub(in_chroma.high_y, in_chroma.last_row);
        fetch = hn::And(fetch, in_chroma.fetch(d, chroma, kWindow - 1, kTallChromaSteps));
        const auto in_chroma_column = hn::ConvertTo(di, in_chroma.column),
                   in_chroma_row = hn::ConvertTo(di, in_chroma.last_row);
        const size_t block = (static_cast<size_t>(pair) * pitch + i) / 2;
        store_blocks(corner(chroma, in_chroma_column, in_chroma_row), out.chroma_corner.data() + block);
        // The position of chroma sample k in luma's pixels, 2 k + 0.5.
        constexpr std::integral_constant<int, kPositionBits + 1> kChroma;
        constexpr uint32_t kHalfPixel = 1 << (kPositionBits - 1);
        store_blocks(hn::BitCast(di, origin(kChroma, in_chroma_column, in_chroma_row, kHalfPixel << 16 | kHalfPixel)),
                     reinterpret_cast<int32_t*>(out.chroma_origin.data()) + block);
      }
      const auto common = hn::And(fetch, hn::Shuffle2301(fetch));
      const auto when = [&](int least, int v, auto otherwise)
                            HWY_ATTR { return hn::IfThenElse(hn::Gt(common, code(least - 1)), code(v), otherwise); };
      const auto verdict = when(kFlatBit, SlotBand::kShuffle,
                                when(kTallBit, SlotBand::kTall, when(kSampleBit, SlotBand::kSample, lost_block)));
      store_blocks(verdict, band.verdict.data() + pair * band.verdict_pitch + i / 2);
      const auto shuffled = hn::Eq(verdict, code(SlotBand::kShuffle));
      calm = hn::Or(calm, hn::IfThenElseZero(shuffled, code(1 << pair)));
    }
    store_blocks(calm, out.calm_pairs.data() + i / 2);
  }
}

// Places a slot in a band through a focal map whose nodes are kCell apart.
inline void place_cells(const Slot& slot, bool i420, int y, bool follows, const CellNodes& inverse, CellWork& work,
                        SlotBand& band) {
  SurfaceBand& out = band.surface;
  work.resize(out.pitch);
  const size_t halves = 2 * static_cast<size_t>(band.blocks), first = 2 * static_cast<size_t>(band.first_block);
  const int ready = follows ? kCellRows - kBandRows / kCell : 0;  // rows of nodes
  const int ready_cells = std::max(ready - 1, 0);
  out.first_row = (y / kCell + kCellRows - 1) % kCellRows;
  project_cells(slot, inverse, first, halves + 1, y, ready, out, work);
  doubt_cells(slot, inverse, first, halves + 1, ready_cells, out, work.doubt);
  for (int k = ready; k < kCellRows; k++) fix_nodes(work, k, halves, out);
  for (int k = ready_cells; k + 1 < kCellRows; k++) fix_cells(work, k, halves, out);
  decide_cells(slot, i420, band);
}

#else

// A machine without vectors goes the slow way everywhere.
inline void place_cells(const Slot&, bool, int, bool, const CellNodes&, CellWork&, SlotBand& band) {
  std::ranges::fill(band.verdict, SlotBand::kProject);
  std::ranges::fill(band.surface.calm_pairs, 0);
}

#endif

// Places a slot in a band with a focal map: all that is known before any pixel is read. `band` has its blocks already.
// `follows`: the band follows the one that `band` has been. `inverse` null: the map has other nodes, and all is to be
// projected.
inline void place_surface(bool i420, const Slot& slot, int y, bool follows, const CellNodes* inverse, CellWork& work,
                          SlotBand& band) {
  SurfaceBand& out = band.surface;
  band.calm = false;
  band.mapped = true;
  out.resize(band.blocks);
  band.verdict_pitch = out.pitch / 2;
  band.verdict.resize(std::max(band.verdict.size(), static_cast<size_t>(band.verdict_pitch) * kBandPairs));
  if (inverse) return place_cells(slot, i420, y, follows, *inverse, work, band);
  std::ranges::fill(band.verdict, SlotBand::kProject);
  std::ranges::fill(out.calm_pairs, 0);
}

}  // namespace lf::simd::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();
#endif
