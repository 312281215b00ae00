// SPDX-License-Identifier: LGPL-2.1-or-later
// Per target, see render_band.cc: the rows of a band between the nodes of a focal map, and how they are fetched.
#if defined(LF_RENDER_SIMD_SURFACE_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef LF_RENDER_SIMD_SURFACE_INL_H_
#undef LF_RENDER_SIMD_SURFACE_INL_H_
#else
#define LF_RENDER_SIMD_SURFACE_INL_H_
#endif

#include <algorithm>
#include <utility>
#include <vector>

#include <hwy/highway.h>

#include "render/simd/band_data.h"
#include "render/simd/cells-inl.h"
#include "render/simd/fixed-inl.h"
#include "render/simd/positions-inl.h"
#include "render/sum_renderer.h"

HWY_BEFORE_NAMESPACE();
namespace lf::simd::HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

// A row of the view between two rows of nodes.
struct CellRow {
  explicit CellRow(float y)
      : k(static_cast<int>((y - kBeforeCell) / kCell)), t((y - kBeforeCell) / kCell - static_cast<float>(k)) {}
  template <class D>
  HWY_INLINE auto between(D d, const std::vector<float>* rows, size_t i) const {
    const auto upper = hn::LoadU(d, rows[k].data() + i);
    return hn::MulAdd(hn::Set(d, t), hn::Sub(hn::LoadU(d, rows[k + 1].data() + i), upper), upper);
  }
  template <class D>
  HWY_INLINE auto node(D d, const std::vector<float>* rows, const std::vector<float>* bend, size_t i) const {
    return hn::MulAdd(hn::Set(d, t * (1 - t)), hn::LoadU(d, bend[k].data() + i), between(d, rows, i));
  }
  int k;
  float t;
};

// A block's half, or another piece of a row, in one coordinate: N nodes and the bends between them.
template <class V, int N>
struct CellPiece {
  V node[N], bend[N - 1];
  // Bounds of samples that begin at `first` of the first cell and end at `last` of the last one.
  template <class D>
  HWY_INLINE void bounds(D d, float first, float last, V& low, V& high) const {
    const auto at = [&](int k, float t)
                        HWY_ATTR { return hn::MulAdd(hn::Set(d, t), hn::Sub(node[k + 1], node[k]), node[k]); };
    const auto begin = at(0, first), end = at(N - 2, last);
    low = hn::Min(begin, end);
    high = hn::Max(begin, end);
    auto most = hn::Abs(bend[0]);
    for (int k = 1; k < N - 1; k++) {
      low = hn::Min(low, node[k]);
      high = hn::Max(high, node[k]);
      most = hn::Max(most, hn::Abs(bend[k]));
    }
    const auto slack = hn::MulAdd(hn::Set(d, kMostBend), most, hn::Set(d, kSlack));
    low = hn::Sub(low, slack);
    high = hn::Add(high, slack);
  }
  // 0, or NaN where there is one: Min and Max may lose it.
  template <class D>
  HWY_INLINE V nowhere(D d) const {
    auto sum = node[0];
    for (int k = 1; k < N; k++) sum = hn::Add(sum, hn::Add(node[k], bend[k - 1]));
    return hn::Mul(hn::Zero(d), sum);
  }
};

// How the samples of some blocks are fetched, whose positions are within these bounds; doubtful ones are kMixed.
template <class D, class V = hn::Vec<D>>
struct CellVerdict {
  CellVerdict(D d, const PlaneGeometry& plane, V low_x, V high_x, V low_y, V high_y, V doubt) : d(d) {
    const auto set = [d](float v) HWY_ATTR { return hn::Set(d, v); };
    column = hn::Floor(low_x);
    row = hn::Floor(low_y);
    // NaN fails every comparison.
    const auto linear = hn::Lt(doubt, set(static_cast<float>(kGridError)));
    const auto inside =
        hn::And(hn::And(hn::Ge(low_x, set(0)), hn::Lt(high_x, set(plane.width - 1 - plane.spare_columns))),
                hn::And(hn::Ge(low_y, set(0)), hn::Lt(high_y, set(plane.height - 1))));
    // Fixed point ends at 32 pixels across and 16 down.
    const auto fits =
        hn::And(hn::Lt(hn::Sub(high_x, column), set(2 * kWindow - 1)), hn::Lt(hn::Sub(high_y, row), set(kWindow - 1)));
    good = hn::And(hn::And(inside, linear), fits);
    const auto outside = hn::Or(hn::Or(hn::Lt(high_x, set(-0.5f)), hn::Gt(low_x, set(plane.width - 0.5f))),
                                hn::Or(hn::Lt(high_y, set(-0.5f)), hn::Gt(low_y, set(plane.height - 0.5f))));
    lost = hn::And(outside, linear);
    const auto third = hn::Add(row, set(2));
    const auto readable =
        hn::Or(hn::Lt(third, set(plane.height - 1)),
               hn::And(hn::Le(third, set(plane.height - 1)), hn::Le(hn::Add(column, set(kWindow)), set(plane.width))));
    narrow = hn::And(readable, hn::And(hn::Lt(hn::Sub(hn::Floor(high_x), column), set(kWindow - 1)),
                                       hn::Lt(hn::Sub(hn::Floor(high_y), row), set(1.5f))));
  }
  // Steps between nodes, and bends, have to fit into fixed point, too.
  template <int N>
  HWY_INLINE void limit(const CellPiece<V, N>& piece) {
    auto most =
        hn::Max(hn::Abs(hn::Sub(piece.node[1], piece.node[0])), hn::Abs(hn::Sub(piece.node[N - 1], piece.node[N - 2])));
    for (int k = 1; k < N - 2; k++) most = hn::Max(most, hn::Abs(hn::Sub(piece.node[k + 1], piece.node[k])));
    for (const V& bend : piece.bend) most = hn::Max(most, hn::Abs(bend));
    good = hn::And(good, hn::Lt(most, hn::Set(d, static_cast<float>(kWindow - 1))));
  }
  // Whether a plane of chroma is lost follows luma.
  HWY_INLINE void store(const PlaneGeometry& plane, bool chroma, size_t i, int32_t* corner, int32_t* to) const {
    const hn::RebindToSigned<D> di;
    const auto code = [&](Fetch f) HWY_ATTR { return hn::Set(di, static_cast<int32_t>(f)); };
    auto fetch = code(Fetch::kMixed);
    if (!chroma) fetch = hn::IfThenElse(hn::RebindMask(di, lost), code(Fetch::kLost), fetch);
    fetch = hn::IfThenElse(hn::RebindMask(di, good), code(Fetch::kGather), fetch);
    if (plane.shuffles) fetch = hn::IfThenElse(hn::RebindMask(di, hn::And(good, narrow)), code(Fetch::kShuffle), fetch);
    hn::StoreU(fetch, di, to + i);
    const auto in_row = hn::Mul(hn::ConvertTo(di, column), hn::Set(di, plane.pixel_bytes));
    hn::StoreU(hn::Add(hn::Mul(hn::ConvertTo(di, row), hn::Set(di, plane.stride)), in_row), di, corner + i);
  }
  D d;
  hn::Mask<D> good, lost, narrow;
  V column, row;
};

// Fixed point relative to a window's corner, modulo 2^16; two of them.
template <class D, class V = hn::Vec<D>>
HWY_INLINE auto fixed_pair(D d, V low, V high, V corner) {
  const auto fixed = [&](V v) HWY_ATTR {
    return to_low_bits(hn::Mul(hn::Sub(v, corner), hn::Set(d, static_cast<float>(1 << kPositionBits))));
  };
  return hn::Or(hn::And(fixed(low), hn::Set(hn::RebindToUnsigned<D>(), 0xffff)), hn::ShiftLeft<16>(fixed(high)));
}

// A row of luma, or of RGB.
inline void place_cell_row(const PlaneGeometry& plane, const CellRow& row, size_t halves, size_t entry,
                           SurfaceBand& out) {
  const hn::CappedTag<float, kBlock> d;
  using V = hn::Vec<decltype(d)>;
  for (size_t i = 0; i < halves; i += hn::Lanes(d)) {
    const auto piece = [&](const CellNodes& node, const CellNodes& down, const CellNodes& along) HWY_ATTR {
      return CellPiece<V, 4>{
          {row.node(d, node.even, down.even, i), row.node(d, node.odd, down.odd, i),
           row.node(d, node.even, down.even, i + 1), row.node(d, node.odd, down.odd, i + 1)},
          {row.between(d, along.even, i), row.between(d, along.odd, i), row.between(d, along.even, i + 1)}};
    };
    const auto x = piece(out.x, out.down_x, out.along_x), y = piece(out.y, out.down_y, out.along_y);
    V low_x, high_x, low_y, high_y;
    x.bounds(d, 0.625f, 0.375f, low_x, high_x);
    y.bounds(d, 0.625f, 0.375f, low_y, high_y);
    const float *const even = out.doubt.even[row.k].data() + i, *const odd = out.doubt.odd[row.k].data() + i;
    const auto doubt = hn::Max(hn::Max(hn::LoadU(d, even), hn::LoadU(d, odd)), hn::LoadU(d, even + 1));
    CellVerdict verdict(d, plane, low_x, high_x, low_y, high_y, hn::Add(doubt, x.nowhere(d)));
    verdict.limit(x);
    verdict.limit(y);
    const auto store = [&](auto a, auto b, auto c, auto e, int16_t* to) HWY_ATTR {
      hn::StoreInterleaved4(a, b, c, e, hn::RebindToUnsigned<decltype(d)>(), reinterpret_cast<uint32_t*>(to));
    };
    const auto zero = hn::Zero(d);
    store(fixed_pair(d, x.node[0], x.node[1], verdict.column), fixed_pair(d, x.node[2], x.node[3], verdict.column),
          fixed_pair(d, y.node[0], y.node[1], verdict.row), fixed_pair(d, y.node[2], y.node[3], verdict.row),
          out.luma_nodes.data() + 8 * (entry + i));
    store(fixed_pair(d, x.bend[0], x.bend[1], zero), fixed_pair(d, x.bend[2], zero, zero),
          fixed_pair(d, y.bend[0], y.bend[1], zero), fixed_pair(d, y.bend[2], zero, zero),
          out.luma_bends.data() + 8 * (entry + i));
    verdict.store(plane, false, i, out.luma_corner.data() + entry, out.luma_fetch.data() + entry);
  }
}

// A row of chroma: sample k sits at luma 2 k + 0.5. Four of each half, at 3/4, 1/4, 3/4, 1/4 of its cells. `entry`: in
// halves.
inline void place_chroma_cell_row(const PlaneGeometry& plane, const CellRow& row, size_t halves, size_t entry,
                                  SurfaceBand& out) {
  const hn::CappedTag<float, kBlock> d;
  using V = hn::Vec<decltype(d)>;
  const auto half = hn::Set(d, 0.5f);
  for (size_t i = 0; i <= halves; i += hn::Lanes(d)) {
    const auto keep = [&](const CellNodes& node, const CellNodes& down, const CellNodes& along, CellLine& to) HWY_ATTR {
      const auto chroma = [&](auto v) HWY_ATTR { return hn::Mul(half, hn::Sub(v, half)); };
      hn::StoreU(chroma(row.node(d, node.even, down.even, i)), d, to.even.data() + i);
      hn::StoreU(chroma(row.node(d, node.odd, down.odd, i)), d, to.odd.data() + i);
      hn::StoreU(hn::Mul(half, row.between(d, along.even, i)), d, to.even_bend.data() + i);
      hn::StoreU(hn::Mul(half, row.between(d, along.odd, i)), d, to.odd_bend.data() + i);
    };
    keep(out.x, out.down_x, out.along_x, out.line_x);
    keep(out.y, out.down_y, out.along_y, out.line_y);
  }
  const size_t blocks = halves / 2, first = entry / 2;
  for (size_t b = 0; b < blocks; b += hn::Lanes(d)) {
    const auto piece = [&](const CellLine& from) HWY_ATTR {
      CellPiece<V, 6> out;
      V rest;
      hn::LoadInterleaved2(d, from.even.data() + 2 * b, out.node[0], out.node[2]);
      hn::LoadInterleaved2(d, from.odd.data() + 2 * b, out.node[1], out.node[3]);
      hn::LoadInterleaved2(d, from.even.data() + 2 * b + 2, out.node[4], rest);
      hn::LoadInterleaved2(d, from.odd.data() + 2 * b + 2, out.node[5], rest);
      hn::LoadInterleaved2(d, from.even_bend.data() + 2 * b, out.bend[0], out.bend[2]);
      hn::LoadInterleaved2(d, from.odd_bend.data() + 2 * b, out.bend[1], out.bend[3]);
      hn::LoadInterleaved2(d, from.even_bend.data() + 2 * b + 2, out.bend[4], rest);
      return out;
    };
    const auto x = piece(out.line_x), y = piece(out.line_y);
    V low_x, high_x, low_y, high_y;
    x.bounds(d, 0.75f, 0.25f, low_x, high_x);
    y.bounds(d, 0.75f, 0.25f, low_y, high_y);
    V even, odd, next, rest;
    hn::LoadInterleaved2(d, out.doubt.even[row.k].data() + 2 * b, even, next);
    hn::LoadInterleaved2(d, out.doubt.odd[row.k].data() + 2 * b, odd, rest);
    auto doubt = hn::Max(hn::Max(even, next), hn::Max(odd, rest));
    hn::LoadInterleaved2(d, out.doubt.even[row.k].data() + 2 * b + 2, even, next);
    doubt = hn::Max(doubt, even);
    CellVerdict verdict(d, plane, low_x, high_x, low_y, high_y, hn::Add(doubt, x.nowhere(d)));
    verdict.limit(x);
    verdict.limit(y);
    const auto store = [&](const auto& piece, auto corner, std::vector<int16_t>& nodes,
                           std::vector<int16_t>& bends) HWY_ATTR {
      const hn::RebindToUnsigned<decltype(d)> du;
      const auto zero = hn::Zero(d);
      hn::StoreInterleaved4(fixed_pair(d, piece.node[0], piece.node[1], corner),
                            fixed_pair(d, piece.node[2], piece.node[3], corner),
                            fixed_pair(d, piece.node[4], piece.node[5], corner), hn::Zero(du), du,
                            reinterpret_cast<uint32_t*>(nodes.data() + 8 * (first + b)));
      hn::StoreInterleaved4(fixed_pair(d, piece.bend[0], piece.bend[1], zero),
                            fixed_pair(d, piece.bend[2], piece.bend[3], zero), fixed_pair(d, piece.bend[4], zero, zero),
                            hn::Zero(du), du, reinterpret_cast<uint32_t*>(bends.data() + 8 * (first + b)));
    };
    store(x, verdict.column, out.chroma_x_nodes, out.chroma_x_bends);
    store(y, verdict.row, out.chroma_y_nodes, out.chroma_y_bends);
    verdict.store(plane, true, b, out.chroma_corner.data() + first, out.chroma_fetch.data() + first);
  }
}

// What is done with each pair of rows of each block: band.verdict, as decide().
inline void decide_cells(bool i420, SlotBand& band) {
  constexpr int32_t kLost = static_cast<int32_t>(Fetch::kLost), kGather = static_cast<int32_t>(Fetch::kGather);
  const SurfaceBand& surface = band.surface;
  for (int pair = 0; pair < kBandPairs; pair++) {
    const int32_t* const upper = surface.luma_fetch.data() + static_cast<ptrdiff_t>(2 * pair) * surface.pitch;
    const int32_t* const lower = upper + surface.pitch;
    const int32_t* const chroma = surface.chroma_fetch.data() + static_cast<ptrdiff_t>(pair) * surface.pitch / 2;
    for (int i = 0; i < band.blocks; i++) {
      const int32_t low = std::min(std::min(upper[2 * i], upper[2 * i + 1]), std::min(lower[2 * i], lower[2 * i + 1]));
      const int32_t high = std::max(std::max(upper[2 * i], upper[2 * i + 1]), std::max(lower[2 * i], lower[2 * i + 1]));
      const int32_t least = i420 ? std::min(low, chroma[i]) : low;
      int32_t v = least > kGather ? SlotBand::kShuffle : SlotBand::kSample;
      v = least < kGather ? SlotBand::kProject : v;
      band.verdict[pair * band.pitch + i] = low == kLost && high == kLost ? SlotBand::kAllLost : v;
    }
  }
}

// Rows of nodes that the next band has, too.
inline void keep_rows(SurfaceBand& band) {
  constexpr int kKept = kCellRows - kBandRows / kCell;
  for (CellNodes* nodes :
       {&band.x, &band.y, &band.z, &band.along_x, &band.along_y, &band.down_x, &band.down_y, &band.doubt})
    for (int k = 0; k < kKept; k++) {
      std::swap(nodes->even[k], nodes->even[k + kBandRows / kCell]);
      std::swap(nodes->odd[k], nodes->odd[k + kBandRows / kCell]);
    }
}

// All that is known of a slot in a band before any pixel of it is read. band's blocks are set. `follows`: on the band
// that is there already. `inverse`: null: of another map, all is to be projected.
inline void place_surface(bool i420, const Slot& slot, int y, bool follows, const CellNodes* inverse, SlotBand& band) {
  SurfaceBand& out = band.surface;
  lay_nodes(band.blocks + 3, band);
  band.calm = false;
  if (!inverse) {
    std::ranges::fill(band.verdict, SlotBand::kProject);
    return;
  }
  out.resize(band.blocks);
  const size_t halves = 2 * static_cast<size_t>(band.blocks), first = 2 * static_cast<size_t>(band.first_block);
  int ready = 0;  // rows of nodes
  if (follows) {
    keep_rows(out);
    ready = kCellRows - kBandRows / kCell;
  }
  project_cells(slot, *inverse, first, halves + 1, y, ready, out);
  doubt_cells(slot, *inverse, first, halves + 1, std::max(ready - 1, 0), out);
  const PlaneGeometry luma = luma_geometry(slot.image, i420);
  for (int r = 0; r < kBandRows; r++)
    place_cell_row(luma, CellRow(static_cast<float>(r)), halves, static_cast<size_t>(r) * out.pitch, out);
  if (i420)
    for (int pair = 0; pair < kBandPairs; pair++)
      place_chroma_cell_row(chroma_geometry(slot.image), CellRow(static_cast<float>(2 * pair) + 0.5f), halves,
                            static_cast<size_t>(pair) * out.pitch, out);
  decide_cells(i420, band);
}

}  // namespace lf::simd::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();
#endif
