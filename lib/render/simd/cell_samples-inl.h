// SPDX-License-Identifier: LGPL-2.1-or-later
// Per target, see render_band.cc: samples of one plane and row of a block between the nodes of a focal map.
#if defined(LF_RENDER_SIMD_CELL_SAMPLES_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef LF_RENDER_SIMD_CELL_SAMPLES_INL_H_
#undef LF_RENDER_SIMD_CELL_SAMPLES_INL_H_
#else
#define LF_RENDER_SIMD_CELL_SAMPLES_INL_H_
#endif

#include <algorithm>
#include <vector>

#include <hwy/highway.h>

#include "render/simd/band_data.h"
#include "render/simd/samples-inl.h"
#include "render/simd/surface-inl.h"

HWY_BEFORE_NAMESPACE();
namespace lf::simd::HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

// Where the samples of a half are among the cells of a focal map: from which node on, and how far. Eight of luma lie
// between four nodes, eight of chroma, a whole block's, between six.
struct CellTable {
  // Bytes of node positions in 16 bits: x of the node before each sample and of the one after it. y of luma is behind
  // x.
  alignas(16) uint8_t before[kBlock], after[kBlock];
  alignas(16) int16_t t15[kHalf], bend15[kHalf];  // t and t (1 - t), 32768 = 1
  // The same in 32 bits, four samples at a time, of four nodes each.
  alignas(16) uint8_t before32[2 * kBlock], after32[2 * kBlock];
  alignas(32) float t[kHalf];
};

constexpr CellTable make_cell_table(bool chroma) {
  CellTable table{};
  for (int i = 0; i < kHalf; i++) {
    const float place = (chroma ? 2 * static_cast<float>(i) + 0.5f : static_cast<float>(i)) + 2.5f;
    const int node = static_cast<int>(place / kCell), near = chroma && i >= kHalf / 2 ? node - 2 : node;
    table.t[i] = place / kCell - static_cast<float>(node);
    table.t15[i] = static_cast<int16_t>(table.t[i] * 32768);
    table.bend15[i] = static_cast<int16_t>(table.t[i] * (1 - table.t[i]) * 32768);
    for (int byte = 0; byte < 2; byte++) {
      table.before[2 * i + byte] = static_cast<uint8_t>(2 * node + byte);
      table.after[2 * i + byte] = static_cast<uint8_t>(2 * node + 2 + byte);
    }
    for (int byte = 0; byte < 4; byte++) {
      table.before32[4 * i + byte] = static_cast<uint8_t>(4 * near + byte);
      table.after32[4 * i + byte] = static_cast<uint8_t>(4 * near + 4 + byte);
    }
  }
  return table;
}
inline constexpr CellTable kLumaCells = make_cell_table(false), kChromaCells = make_cell_table(true);

// Positions between nodes in 16 bits, modulo 2^16; `offset`: of the first node in `nodes` and bend in `bends`, bytes.
HWY_INLINE V16 between_nodes(V16 nodes, V16 bends, const CellTable& table, int offset) {
  const D16 d;
  const hn::Repartition<uint8_t, D16> d8;
  const auto look_up = [&](V16 in, const uint8_t* from) HWY_ATTR {
    const auto at = hn::Add(hn::LoadDup128(d8, from), hn::Set(d8, static_cast<uint8_t>(offset)));
    return hn::BitCast(d, hn::TableLookupBytes(hn::BitCast(d8, in), at));
  };
  const auto before = look_up(nodes, table.before), after = look_up(nodes, table.after);
  const auto bent = hn::MulFixedPoint15(look_up(bends, table.before), hn::LoadDup128(d, table.bend15));
  const auto along = hn::MulFixedPoint15(hn::Sub(after, before), hn::LoadDup128(d, table.t15));
  return hn::Add(hn::Add(before, along), bent);
}

// Luma of a block whose first half has this entry; chroma of the block with one.
struct FixedPositions {
  V16 x, y;
};
HWY_INLINE FixedPositions luma_between(const SurfaceBand& cells, size_t entry, size_t lane) {
  constexpr int kToY = 4 * sizeof(int16_t);
  const auto node = hn::LoadU(D16(), cells.luma_nodes.data() + 8 * entry + lane);
  const auto bend = hn::LoadU(D16(), cells.luma_bends.data() + 8 * entry + lane);
  return {between_nodes(node, bend, kLumaCells, 0), between_nodes(node, bend, kLumaCells, kToY)};
}
HWY_INLINE FixedPositions chroma_between(const SurfaceBand& cells, size_t entry) {
  const auto along = [entry](const std::vector<int16_t>& nodes, const std::vector<int16_t>& bends) HWY_ATTR {
    return between_nodes(hn::LoadDup128(D16(), nodes.data() + 8 * entry),
                         hn::LoadDup128(D16(), bends.data() + 8 * entry), kChromaCells, 0);
  };
  return {along(cells.chroma_x_nodes, cells.chroma_x_bends), along(cells.chroma_y_nodes, cells.chroma_y_bends)};
}

// Samples of windows that hold all that is needed; `low`, `high`: where those of the halves begin, Cb's and Cr's.
HWY_INLINE VU16 sample_cells(const SurfaceBand& cells, size_t entry, const uint8_t* low, const uint8_t* high,
                             ptrdiff_t stride, size_t lane) {
  const FixedPositions at = luma_between(cells, entry, lane);
  return sample_windows(hn::BitCast(DU16(), at.x), at.y, low, high, stride, lane);
}
HWY_INLINE VU16 sample_chroma_cells(const SurfaceBand& cells, size_t entry, const uint8_t* cb, const uint8_t* cr,
                                    ptrdiff_t stride, size_t lane) {
  const FixedPositions at = chroma_between(cells, entry);
  return sample_windows(hn::BitCast(DU16(), at.x), at.y, cb, cr, stride, lane);
}

// Positions of the samples of a block's row where no window holds them.
inline void interpolate_cells(const SurfaceBand& cells, size_t entry, bool chroma, Positions& out) {
  const D16 d;
  const DU16 du;
  constexpr int kTo15 = 15 - kPositionBits;
  alignas(64) uint16_t column[kBlock];
  alignas(64) int16_t row[kBlock];
  for (size_t lane = 0; lane < kBlock; lane += hn::Lanes(d)) {
    const FixedPositions at = chroma ? chroma_between(cells, entry) : luma_between(cells, entry, lane);
    const auto fraction = [&](V16 v) HWY_ATTR {
      return hn::ShiftLeft<kTo15>(hn::And(v, hn::Set(d, (1 << kPositionBits) - 1)));
    };
    hn::Store(hn::ShiftRight<kPositionBits>(hn::BitCast(du, at.x)), du, column + lane);
    hn::Store(hn::ShiftRight<kPositionBits>(at.y), d, row + lane);
    hn::Store(fraction(at.x), d, out.fx + lane);
    hn::Store(fraction(at.y), d, out.fy + lane);
  }
  std::copy_n(column, kBlock, out.column);
  std::copy_n(row, kBlock, out.row);
  for (int half = 0; half < 2; half++)
    out.corner[half] = chroma ? cells.chroma_corner[entry] : cells.luma_corner[entry + half];
}

// Inverse distances of a block's samples in a row, those of chroma twice over. `half`: the block's first one in the
// view.
inline void inverse_along(const CellNodes& inverse, const CellRow& row, size_t half, bool chroma, float* out) {
  const hn::CappedTag<float, kHalf> d;
  const hn::Repartition<uint8_t, decltype(d)> d8;
  const CellTable& table = chroma ? kChromaCells : kLumaCells;
  alignas(16) float nodes[2][4];  // of the halves
  for (size_t k = 0; k < 2; k++)
    for (size_t n = 0; n < 4; n++) {
      const std::vector<float>* const rows = n % 2 ? inverse.odd : inverse.even;
      const float upper = rows[row.k][half + k + n / 2], lower = rows[row.k + 1][half + k + n / 2];
      nodes[k][n] = upper + row.t * (lower - upper);
    }
  for (size_t lane = 0; lane < (chroma ? kHalf : kBlock); lane += hn::Lanes(d)) {
    const size_t in_half = lane % kHalf;
    // Four samples of chroma to a half, eight of luma.
    auto four = hn::LoadDup128(d, nodes[chroma ? lane / 4 : lane / kHalf]);
    if (chroma && hn::Lanes(d) > 4) four = hn::ConcatUpperLower(d, hn::LoadDup128(d, nodes[1]), four);
    const auto look_up = [&](const uint8_t* at) HWY_ATTR {
      return hn::BitCast(d, hn::TableLookupBytes(hn::BitCast(d8, four), hn::LoadU(d8, at + 4 * in_half)));
    };
    const auto before = look_up(table.before32);
    const auto s = hn::MulAdd(hn::LoadU(d, table.t + in_half), hn::Sub(look_up(table.after32), before), before);
    hn::Store(s, d, out + lane);
    if (chroma) hn::Store(s, d, out + kHalf + lane);
  }
}

}  // namespace lf::simd::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();
#endif
