// SPDX-License-Identifier: LGPL-2.1-or-later
// Per target, see render_band.cc: the rows of a band between the nodes of a focal map, and how they are fetched.
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
#include "render/simd/fixed-inl.h"
#include "render/simd/positions-inl.h"
#if HWY_TARGET != HWY_SCALAR
#include "render/simd/samples-inl.h"
#endif
#include "render/sum_renderer.h"

HWY_BEFORE_NAMESPACE();
namespace lf::simd::HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

// A row of the view between two rows of nodes.
struct CellRow {
  explicit CellRow(float y)
      : k(static_cast<int>((y - kBeforeCell) / kCell)), t((y - kBeforeCell) / kCell - static_cast<float>(k)) {}
  int k;
  float t;
};

// A pair of rows lies between the same two rows of nodes: the upper one at first_t(), the lower a quarter of a cell
// below, and chroma in the middle of them.
static_assert(kCell == 4 && kBandRows == 8);
inline constexpr int cell_of_pair(int pair) { return (pair + 1) / 2; }
inline constexpr float first_t(int pair) { return pair % 2 ? 0.125f : 0.625f; }

// What fixed point may be off by: nodes, steps and bends are rounded down and along.
inline constexpr float kCellSlack = 4.f / (1 << kPositionBits);
inline constexpr float kMostStep = kWindow - 1;  // from node to node, and bends: 16 is where 16 bits end

// A half in one coordinate, at a row of nodes: those around it and how it bends between them.
template <class D, class V = hn::Vec<D>>
struct CellPiece {
  CellPiece(D d, const float* even, const float* odd, const float* even_bend, const float* odd_bend)
      : node{hn::LoadU(d, even), hn::LoadU(d, odd), hn::LoadU(d, even + 1), hn::LoadU(d, odd + 1)},
        bend{hn::LoadU(d, even_bend), hn::LoadU(d, odd_bend), hn::LoadU(d, even_bend + 1)} {}
  // Of samples, the first of which is at 5/8 of the first cell and the last at 3/8 of the last one. NaN where there is
  // one, which Min and Max may lose, or where steps are too large.
  HWY_INLINE void bounds(D d, V& low, V& high) const {
    const auto set = [d](float v) HWY_ATTR { return hn::Set(d, v); };
    const V step0 = hn::Sub(node[1], node[0]), step1 = hn::Sub(node[2], node[1]), step2 = hn::Sub(node[3], node[2]);
    const auto begin = hn::MulAdd(set(0.625f), step0, node[0]), end = hn::MulAdd(set(0.375f), step2, node[2]);
    const auto bends = hn::Max(hn::Max(hn::Abs(bend[0]), hn::Abs(bend[1])), hn::Abs(bend[2]));
    const auto most = hn::Max(hn::Max(hn::Abs(step0), hn::Abs(step1)), hn::Max(hn::Abs(step2), bends));
    const auto sum = hn::Add(hn::Add(hn::Add(node[0], node[1]), hn::Add(node[2], node[3])),
                             hn::Add(hn::Add(bend[0], bend[1]), bend[2]));
    const auto good = hn::And(hn::Lt(most, set(kMostStep)), hn::Eq(sum, sum));
    const auto slack = hn::IfThenElse(good, hn::Mul(set(kMostBend), bends), hn::NaN(d));
    low = hn::Sub(hn::Min(hn::Min(begin, end), hn::Min(node[1], node[2])), slack);
    high = hn::Add(hn::Max(hn::Max(begin, end), hn::Max(node[1], node[2])), slack);
  }
  V node[4], bend[3];
};

// Two values in fixed point, modulo 2^16, which `magic` brings to their place: see to_low_bits().
template <class D, class V = hn::Vec<D>>
HWY_INLINE auto fixed_pair(D d, V low, V high, V magic) {
  const hn::RebindToUnsigned<D> du;
  const auto fixed = [&](V v) HWY_ATTR {
    return hn::BitCast(du, hn::MulAdd(v, hn::Set(d, static_cast<float>(1 << kPositionBits)), magic));
  };
  return hn::Or(hn::And(fixed(low), hn::Set(du, 0xffff)), hn::ShiftLeft<16>(fixed(high)));
}
template <class D, class V = hn::Vec<D>>
HWY_INLINE void store_fixed(D d, const V x[4], V magic_x, const V y[4], V magic_y, int16_t* to) {
  hn::StoreInterleaved4(fixed_pair(d, x[0], x[1], magic_x), fixed_pair(d, x[2], x[3], magic_x),
                        fixed_pair(d, y[0], y[1], magic_y), fixed_pair(d, y[2], y[3], magic_y),
                        hn::RebindToUnsigned<D>(), reinterpret_cast<uint32_t*>(to));
}

// Fixed point and bounds at row k of nodes.
inline void fix_nodes(const CellWork& work, int k, size_t halves, SurfaceBand& out) {
  const hn::CappedTag<float, kBlock> d;
  const int row = out.row(k);
  constexpr float kTurn = 1 << (16 - kPositionBits);  // pixels after which fixed point begins anew
  for (size_t i = 0; i < halves; i += hn::Lanes(d)) {
    const auto piece = [&](const CellNodes& nodes, const CellNodes& along) HWY_ATTR {
      return CellPiece<decltype(d)>(d, nodes.even[row].data() + i, nodes.odd[row].data() + i, along.even[k].data() + i,
                                    along.odd[k].data() + i);
    };
    const auto x = piece(out.x, work.along_x), y = piece(out.y, work.along_y);
    const size_t at = out.entry(k, i);
    const auto bounds = [&](const auto& of, std::vector<float>& to_low, std::vector<float>& to_high) HWY_ATTR {
      hn::Vec<decltype(d)> low, high;
      of.bounds(d, low, high);
      hn::StoreU(low, d, to_low.data() + at);
      hn::StoreU(high, d, to_high.data() + at);
    };
    bounds(x, out.low_x, out.high_x);
    bounds(y, out.low_y, out.high_y);
    const auto zero = hn::Zero(d), magic = hn::Set(d, kMagic);
    // Near the first node: there are not bits enough for all of an image.
    const auto near = [&](const auto& of) HWY_ATTR {
      const auto turns = hn::Floor(hn::Mul(of.node[0], hn::Set(d, 1 / kTurn)));
      return hn::NegMulAdd(turns, hn::Set(d, kTurn * (1 << kPositionBits)), magic);
    };
    store_fixed(d, x.node, near(x), y.node, near(y), out.nodes.data() + 8 * at);
    const hn::Vec<decltype(d)> along_x[4] = {x.bend[0], x.bend[1], x.bend[2], zero};
    const hn::Vec<decltype(d)> along_y[4] = {y.bend[0], y.bend[1], y.bend[2], zero};
    store_fixed(d, along_x, magic, along_y, magic, out.along.data() + 8 * at);
  }
}

// The cells below row k of nodes.
inline void fix_cells(const CellWork& work, int k, size_t halves, SurfaceBand& out) {
  const hn::CappedTag<float, kBlock> d;
  using V = hn::Vec<decltype(d)>;
  const auto set = [&](float v) HWY_ATTR { return hn::Set(d, v); };
  const int upper = out.row(k), lower = out.row(k + 1);
  for (size_t i = 0; i < halves; i += hn::Lanes(d)) {
    V x[4], y[4];
    const auto load = [&](const CellNodes& of, V to[4]) HWY_ATTR {
      const float *const even = of.even[k].data() + i, *const odd = of.odd[k].data() + i;
      to[0] = hn::LoadU(d, even);
      to[1] = hn::LoadU(d, odd);
      to[2] = hn::LoadU(d, even + 1);
      to[3] = hn::LoadU(d, odd + 1);
    };
    load(work.down_x, x);
    load(work.down_y, y);
    const auto most = [&](const V of[4]) HWY_ATTR {
      return hn::Max(hn::Max(hn::Abs(of[0]), hn::Abs(of[1])), hn::Max(hn::Abs(of[2]), hn::Abs(of[3])));
    };
    const auto sum = [&](const V of[4]) HWY_ATTR { return hn::Add(hn::Add(of[0], of[1]), hn::Add(of[2], of[3])); };
    const auto step = [&](const CellNodes& of) HWY_ATTR {
      const auto across = [&](const std::vector<float>* rows, size_t n) HWY_ATTR {
        return hn::Abs(hn::Sub(hn::LoadU(d, rows[lower].data() + n), hn::LoadU(d, rows[upper].data() + n)));
      };
      return hn::Max(hn::Max(across(of.even, i), across(of.odd, i)),
                     hn::Max(across(of.even, i + 1), across(of.odd, i + 1)));
    };
    const auto most_x = most(x), most_y = most(y);
    const auto largest = hn::Max(hn::Max(most_x, most_y), hn::Max(step(out.x), step(out.y)));
    const float *const even = work.doubt.even[k].data() + i, *const odd = work.doubt.odd[k].data() + i;
    // NaN fails every comparison, but is lost in Max.
    const auto doubt = hn::Add(hn::Max(hn::Max(hn::LoadU(d, even), hn::LoadU(d, odd)), hn::LoadU(d, even + 1)),
                               hn::Mul(hn::Zero(d), hn::Add(sum(x), sum(y))));
    const auto good =
        hn::And(hn::Lt(doubt, set(static_cast<float>(kGridError))), hn::Lt(largest, set(kMostStep)));
    const auto slack = [&](V of) HWY_ATTR {
      return hn::IfThenElse(good, hn::MulAdd(set(kMostBend), of, set(kCellSlack)), hn::NaN(d));
    };
    const size_t at = out.entry(k, i);
    hn::StoreU(slack(most_x), d, out.slack_x.data() + at);
    hn::StoreU(slack(most_y), d, out.slack_y.data() + at);
    const auto magic = set(kMagic);
    store_fixed(d, x, magic, y, magic, out.down.data() + 8 * at);
  }
}

#if HWY_TARGET != HWY_SCALAR

// The larger or smaller of the halves of each block, for both of them.
template <class V>
HWY_INLINE V least_of_block(V v) { return hn::Min(v, hn::Shuffle2301(v)); }
template <class V>
HWY_INLINE V most_of_block(V v) { return hn::Max(v, hn::Shuffle2301(v)); }

// Where in an image, or a plane of chroma, the samples of a pair of rows are: bounds of both rows or, of chroma, of the
// one. NaN fails every comparison.
template <class D, class V = hn::Vec<D>>
struct CellPlace {
  V low_x, high_x, low_y, high_y;
  V column, width;     // of windows, and how far samples reach in them
  V last_row, height;  // of the lower row's windows, and the larger of both
  HWY_INLINE auto is_outside(D d, const PlaneGeometry& plane) const {
    return hn::Or(hn::Or(hn::Lt(high_x, hn::Set(d, -0.5f)), hn::Gt(low_x, hn::Set(d, plane.width - 0.5f))),
                  hn::Or(hn::Lt(high_y, hn::Set(d, -0.5f)), hn::Gt(low_y, hn::Set(d, plane.height - 0.5f))));
  }
  // kProject, kSample, kTall or kShuffle. `widest`: where fixed point ends across;
  // `tall`: the most rows that samples may begin on.
  HWY_INLINE auto fetch(D d, const PlaneGeometry& plane, float widest, float tall) const {
    const hn::RebindToSigned<D> di;
    const auto set = [d](float v) HWY_ATTR { return hn::Set(d, v); };
    const auto inside = [&](float border, float right) HWY_ATTR {
      return hn::And(hn::And(hn::Ge(low_x, set(border)), hn::Lt(high_x, set(plane.width - 1 - right))),
                     hn::And(hn::Ge(low_y, set(border)), hn::Lt(high_y, set(plane.height - 1 - border))));
    };
    const auto fits = hn::And(hn::Lt(width, set(widest)), hn::Lt(height, set(kWindow - 1)));
    const auto good = hn::And(inside(0, plane.spare_columns), fits);
    const auto code = [&](hn::Mask<D> when, int v, auto otherwise) HWY_ATTR {
      return hn::IfThenElse(hn::RebindMask(di, when), hn::Set(di, v), otherwise);
    };
    auto out = code(good, SlotBand::kSample, hn::Zero(di));
    if (!plane.shuffles) return out;
    const auto narrow = hn::And(good, hn::Lt(width, set(kWindow - 1 - 2 * plane.border)));
    const auto reaches = plane.border > 0 ? hn::And(narrow, inside(plane.border, plane.border)) : narrow;
    // Windows run over into the next image row: it has to be there.
    const auto rows = [&](float n) HWY_ATTR {
      return hn::And(hn::Lt(height, set(n)), hn::Lt(last_row, set(plane.height - 1 - n - plane.border)));
    };
    out = code(hn::And(reaches, rows(tall)), SlotBand::kTall, out);
    return code(hn::And(reaches, rows(kFlatSteps)), SlotBand::kShuffle, out);
  }
};

// How the pairs of rows of each block are fetched, and from where: band.verdict, as decide().
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
  // In fixed point, pixels and 2^-kBits of one.
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
        fetch = hn::Min(fetch, in_chroma.fetch(d, chroma, kWindow - 1, kTallChromaSteps));
        const auto in_chroma_column = hn::ConvertTo(di, in_chroma.column),
                   in_chroma_row = hn::ConvertTo(di, in_chroma.last_row);
        const size_t block = (static_cast<size_t>(pair) * pitch + i) / 2;
        store_blocks(corner(chroma, in_chroma_column, in_chroma_row), out.chroma_corner.data() + block);
        // Luma's position of that, 2 k + 0.5.
        constexpr std::integral_constant<int, kPositionBits + 1> kChroma;
        constexpr uint32_t kHalfPixel = 1 << (kPositionBits - 1);
        store_blocks(hn::BitCast(di, origin(kChroma, in_chroma_column, in_chroma_row, kHalfPixel << 16 | kHalfPixel)),
                     reinterpret_cast<int32_t*>(out.chroma_origin.data()) + block);
      }
      const auto verdict = hn::Max(least_of_block(fetch), least_of_block(lost));
      store_blocks(verdict, band.verdict.data() + pair * band.verdict_pitch + i / 2);
      const auto shuffled = hn::Eq(verdict, code(SlotBand::kShuffle));
      calm = hn::Or(calm, hn::IfThenElseZero(shuffled, code(1 << pair)));
    }
    store_blocks(calm, out.calm_pairs.data() + i / 2);
  }
}

// Where a map with nodes kCell apart is.
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

// All that is known of a slot in a band before any pixel of it is read. band's blocks are set. `follows`: on the band
// that is there already. `inverse`: null: of another map, all is to be projected.
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
