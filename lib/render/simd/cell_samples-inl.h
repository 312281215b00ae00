// SPDX-License-Identifier: LGPL-2.1-or-later
// Per target, see render_band.cc: samples of one plane and row of a block between the nodes of a focal map.
#if defined(LF_RENDER_SIMD_CELL_SAMPLES_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef LF_RENDER_SIMD_CELL_SAMPLES_INL_H_
#undef LF_RENDER_SIMD_CELL_SAMPLES_INL_H_
#else
#define LF_RENDER_SIMD_CELL_SAMPLES_INL_H_
#endif

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
  alignas(32) float t[kHalf], bend[kHalf];
};

constexpr CellTable make_cell_table(bool chroma) {
  CellTable table{};
  for (int i = 0; i < kHalf; i++) {
    const float place = (chroma ? 2 * static_cast<float>(i) + 0.5f : static_cast<float>(i)) + 2.5f;
    const int node = static_cast<int>(place / kCell), near = chroma && i >= kHalf / 2 ? node - 2 : node;
    table.t[i] = place / kCell - static_cast<float>(node);
    table.bend[i] = table.t[i] * (1 - table.t[i]);
    table.t15[i] = static_cast<int16_t>(table.t[i] * 32768);
    table.bend15[i] = static_cast<int16_t>(table.bend[i] * 32768);
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

// Through a focal map. `nodes`, `bends`: of the block's two halves; `low` and `high`: where their windows begin.
HWY_INLINE VU16 sample_cells(const int16_t* nodes, const int16_t* bends, const uint8_t* low, const uint8_t* high,
                             ptrdiff_t stride, size_t lane) {
  const auto node = hn::LoadU(D16(), nodes + lane), bend = hn::LoadU(D16(), bends + lane);
  constexpr int kToY = 4 * sizeof(int16_t);
  return sample_windows(hn::BitCast(DU16(), between_nodes(node, bend, kLumaCells, 0)),
                        between_nodes(node, bend, kLumaCells, kToY), low, high, stride, lane);
}

// Chroma, the entry of its block: Cb and Cr have a half each.
HWY_INLINE VU16 sample_chroma_cells(const SurfaceBand& cells, size_t entry, const uint8_t* cb, const uint8_t* cr,
                                    ptrdiff_t stride, size_t lane) {
  const auto along = [entry](const std::vector<int16_t>& nodes, const std::vector<int16_t>& bends) HWY_ATTR {
    return between_nodes(hn::LoadDup128(D16(), nodes.data() + 8 * entry),
                         hn::LoadDup128(D16(), bends.data() + 8 * entry), kChromaCells, 0);
  };
  return sample_windows(hn::BitCast(DU16(), along(cells.chroma_x_nodes, cells.chroma_x_bends)),
                        along(cells.chroma_y_nodes, cells.chroma_y_bends), cb, cr, stride, lane);
}

// Values of a half's eight luma samples among its nodes; of chroma, of each half's four.
template <class D>
HWY_INLINE auto along_cells(D d, const CellHalf* halves, bool chroma, size_t lane) {
  const hn::Repartition<uint8_t, D> d8;
  const CellTable& table = chroma ? kChromaCells : kLumaCells;
  const size_t in_half = lane % kHalf;
  const auto look_up = [&](const float* in, const float* in_next, const uint8_t* at) HWY_ATTR {
    auto four = hn::LoadDup128(d, in);
    if (chroma && hn::Lanes(d) > 4) four = hn::ConcatUpperLower(d, hn::LoadDup128(d, in_next), four);
    return hn::BitCast(d, hn::TableLookupBytes(hn::BitCast(d8, four), hn::LoadU(d8, at + 4 * in_half)));
  };
  const CellHalf& half = halves[chroma ? lane / 4 : lane / kHalf];
  const CellHalf& next = halves[chroma ? 1 : lane / kHalf];
  const auto before = look_up(half.node, next.node, table.before32),
             after = look_up(half.node, next.node, table.after32);
  const auto straight = hn::MulAdd(hn::LoadU(d, table.t + in_half), hn::Sub(after, before), before);
  return hn::MulAdd(hn::LoadU(d, table.bend + in_half), look_up(half.bend, next.bend, table.before32), straight);
}

// Positions of all samples of a block. `half`: the first one of the block in `cells`.
inline void interpolate_cells(const SurfaceBand& cells, const CellRow& row, size_t half, bool chroma, Positions& out) {
  const hn::CappedTag<float, kHalf> d;
  CellHalf x[2], y[2];
  for (size_t k = 0; k < 2; k++) {
    x[k] = half_of(cells.x, cells.down_x, cells.along_x, row, half + k, chroma);
    y[k] = half_of(cells.y, cells.down_y, cells.along_y, row, half + k, chroma);
  }
  for (size_t lane = 0; lane < (chroma ? kHalf : kBlock); lane += hn::Lanes(d)) {
    const auto px = along_cells(d, x, chroma, lane), py = along_cells(d, y, chroma, lane), largest = hn::Set(d, 1e9f);
    for (size_t to = lane; to < kBlock; to += kHalf) {
      split(d, px, largest, out.column + to, out.fx + to);
      split(d, py, largest, out.row + to, out.fy + to);
      if (!chroma) break;
    }
  }
}

// Inverse distances of a block's samples in a row, those of chroma twice over. `half`: the block's first one in the
// view.
inline void inverse_along(const CellNodes& inverse, const CellRow& row, size_t half, bool chroma, float* out) {
  const hn::CappedTag<float, kHalf> d;
  CellHalf halves[2];
  for (size_t k = 0; k < 2; k++)
    for (size_t n = 0; n < 4; n++) {
      const std::vector<float>* const rows = n % 2 ? inverse.odd : inverse.even;
      const float upper = rows[row.k][half + k + n / 2], lower = rows[row.k + 1][half + k + n / 2];
      halves[k].node[n] = upper + row.t * (lower - upper);
      halves[k].bend[n] = 0;
    }
  for (size_t lane = 0; lane < (chroma ? kHalf : kBlock); lane += hn::Lanes(d)) {
    const auto s = along_cells(d, halves, chroma, lane);
    hn::Store(s, d, out + lane);
    if (chroma) hn::Store(s, d, out + kHalf + lane);
  }
}

}  // namespace lf::simd::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();
#endif
