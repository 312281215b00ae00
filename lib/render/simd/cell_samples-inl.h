// SPDX-License-Identifier: LGPL-2.1-or-later
// Per target, see render_band.cc: samples of one plane and row of a block between the nodes of a focal map.
#if defined(LF_RENDER_SIMD_CELL_SAMPLES_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef LF_RENDER_SIMD_CELL_SAMPLES_INL_H_
#undef LF_RENDER_SIMD_CELL_SAMPLES_INL_H_
#else
#define LF_RENDER_SIMD_CELL_SAMPLES_INL_H_
#endif

#include <cstring>
#include <vector>

#include <hwy/highway.h>

#include "render/simd/band_data.h"
#include "render/simd/fixed_cells-inl.h"
#include "render/simd/gather-inl.h"
#include "render/simd/samples-inl.h"

HWY_BEFORE_NAMESPACE();
namespace lf::simd::HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

// Tells where the samples of a half are among the cells of a focal map: behind which node, and how far. A half has
// eight samples of luma between four nodes, whose x and y take a lookup each, and four of chroma, whose x and y take
// one together.
struct CellTable {
  // Bytes in the four nodes of x and four of y, in 16 bits: of the node before each sample and of the one after it.
  alignas(16) uint8_t before[kBlock], after[kBlock];
  alignas(16) int16_t t15[kHalf], bend15[kHalf];  // t and t (1 - t), 32768 = 1
};
enum class CellSamples { kLumaX, kLumaY, kChroma };

constexpr CellTable make_cell_table(CellSamples samples) {
  CellTable table{};
  for (int i = 0; i < kHalf; i++) {
    const bool chroma = samples == CellSamples::kChroma;
    const float place = (chroma ? 2 * static_cast<float>(i % 4) + 0.5f : static_cast<float>(i)) + 2.5f;
    const int node = static_cast<int>(place / kCell), of_y = samples == CellSamples::kLumaY || (chroma && i >= 4);
    const float t = place / kCell - static_cast<float>(node);
    table.t15[i] = static_cast<int16_t>(t * 32768);
    table.bend15[i] = static_cast<int16_t>(t * (1 - t) * 32768);
    for (int byte = 0; byte < 2; byte++) {
      table.before[2 * i + byte] = static_cast<uint8_t>(8 * of_y + 2 * node + byte);
      table.after[2 * i + byte] = static_cast<uint8_t>(8 * of_y + 2 * node + 2 + byte);
    }
  }
  return table;
}
inline constexpr CellTable kLumaXCells = make_cell_table(CellSamples::kLumaX),
                           kLumaYCells = make_cell_table(CellSamples::kLumaY),
                           kChromaCells = make_cell_table(CellSamples::kChroma);

// Tables to interpolate inverse distances in 32 bits, four samples at a time, between a half's four nodes.
struct InverseTable {
  alignas(16) uint8_t before[2 * kBlock], after[2 * kBlock];
  alignas(32) float t[kHalf];
};

constexpr InverseTable make_inverse_table(bool chroma) {
  InverseTable table{};
  for (int i = 0; i < kHalf; i++) {
    const float place = (chroma ? 2 * static_cast<float>(i) + 0.5f : static_cast<float>(i)) + 2.5f;
    const int node = static_cast<int>(place / kCell), near = chroma && i >= kHalf / 2 ? node - 2 : node;
    table.t[i] = place / kCell - static_cast<float>(node);
    for (int byte = 0; byte < 4; byte++) {
      table.before[4 * i + byte] = static_cast<uint8_t>(4 * near + byte);
      table.after[4 * i + byte] = static_cast<uint8_t>(4 * near + 4 + byte);
    }
  }
  return table;
}
inline constexpr InverseTable kLumaInverse = make_inverse_table(false), kChromaInverse = make_inverse_table(true);

// The bytes of windows' origins, four of the first half's and four of the second's, that a half's nodes count from.
struct OriginTable {
  alignas(32) uint8_t at[2 * kBlock];
};
constexpr OriginTable make_origin_table() {
  OriginTable table{};
  for (int i = 0; i < 2 * kBlock; i++) table.at[i] = static_cast<uint8_t>(i / 16 * 4 + i % 16 / 8 * 2 + i % 2);
  return table;
}
inline constexpr OriginTable kOrigins = make_origin_table();

// The nodes of a block's halves above and below a pair of rows, and how the sides between them bend; vectors of eight
// values have those of one half.
struct CellsOfPair {
  HWY_INLINE CellsOfPair(const SurfaceBand& cells, int pair, int block, size_t lane) {
    const D16 d;
    const int k = cell_of_pair(pair);
    const size_t half = 2 * static_cast<size_t>(block), upper = 8 * cells.entry(k, half) + lane,
                 lower = 8 * cells.entry(k + 1, half) + lane;
    node = hn::LoadU(d, cells.nodes.data() + upper);
    step = hn::Sub(hn::LoadU(d, cells.nodes.data() + lower), node);
    bend = hn::LoadU(d, cells.along.data() + upper);
    bend_step = hn::Sub(hn::LoadU(d, cells.along.data() + lower), bend);
    down = hn::LoadU(d, cells.down.data() + upper);
  }
  V16 node, step, bend, bend_step, down;
};

// Interpolates the positions of the samples of one row of a pair; chroma's row is in the middle of the pair.
struct CellsOfRow {
  // `eighths`: how far the row is below the upper nodes, in eighths of a cell. `origin`: the windows' origins, for each
  // node.
  HWY_INLINE CellsOfRow(const CellsOfPair& pair, int eighths, V16 origin) {
    const D16 d;
    const auto t = hn::Set(d, static_cast<int16_t>(eighths << 12));
    const auto curve = hn::Set(d, static_cast<int16_t>(eighths * (8 - eighths) << 9));
    const auto straight = hn::Add(hn::Sub(pair.node, origin), hn::MulFixedPoint15(pair.step, t));
    node = hn::Add(straight, hn::MulFixedPoint15(pair.down, curve));
    bend = hn::Add(pair.bend, hn::MulFixedPoint15(pair.bend_step, t));
  }
  HWY_INLINE V16 at(const CellTable& table) const {
    const D16 d;
    const hn::Repartition<uint8_t, D16> d8;
    const auto look_up = [&](V16 in, const uint8_t* from) HWY_ATTR {
      return hn::BitCast(d, hn::TableLookupBytes(hn::BitCast(d8, in), hn::LoadDup128(d8, from)));
    };
    const auto before = look_up(node, table.before);
    const auto bent = hn::MulFixedPoint15(look_up(bend, table.before), hn::LoadDup128(d, table.bend15));
    const auto along = hn::MulFixedPoint15(hn::Sub(look_up(node, table.after), before), hn::LoadDup128(d, table.t15));
    return hn::Add(hn::Add(before, along), bent);
  }
  V16 node, bend;
};
HWY_INLINE int first_eighths(int pair) { return static_cast<int>(8 * first_t(pair)); }

// Positions of the luma samples of a row of a pair, in their windows.
HWY_INLINE FixedPositions luma_between(const SurfaceBand& cells, const CellsOfPair& of, int pair, int row, int block,
                                       size_t lane) {
  const D16 d;
  const hn::Repartition<uint8_t, D16> d8;
  const uint32_t* const from = cells.luma_origin.data() + (2 * pair + row) * ptrdiff_t{cells.pitch} + 2 * block;
  const auto both = [&]() HWY_ATTR {
    if constexpr (hn::MaxLanes(D16()) == kBlock) {
      uint64_t origins;
      std::memcpy(&origins, from, sizeof origins);
      return hn::BitCast(d8, hn::Set(hn::Repartition<uint64_t, D16>(), origins));
    } else {
      return hn::BitCast(d8, hn::Set(hn::Repartition<uint32_t, D16>(), from[lane / kHalf]));
    }
  }();
  const auto origin = hn::BitCast(d, hn::TableLookupBytes(both, hn::LoadU(d8, kOrigins.at)));
  const CellsOfRow cell(of, first_eighths(pair) + 2 * row, origin);
  return {cell.at(kLumaXCells), cell.at(kLumaYCells)};
}
// Positions of the chroma samples of a pair, in their windows. `of`: the nodes at `lane`.
HWY_INLINE FixedPositions chroma_between(const SurfaceBand& cells, const CellsOfPair& of, int pair, int block,
                                         size_t lane) {
  const D16 d;
  const DU16 du;
  const hn::Repartition<uint8_t, D16> d8;
  const hn::Repartition<uint64_t, D16> d64;
  const uint32_t from = cells.chroma_origin[pair * ptrdiff_t{cells.pitch} / 2 + block];
  const auto both = hn::BitCast(d8, hn::Set(hn::Repartition<uint32_t, D16>(), from));
  const auto origin = hn::BitCast(d, hn::TableLookupBytes(both, hn::LoadDup128(d8, kOrigins.at)));
  const auto in_chroma = [&](const CellsOfPair& half) HWY_ATTR {
    const V16 luma = CellsOfRow(half, first_eighths(pair) + 1, origin).at(kChromaCells);
    return hn::BitCast(d64, hn::ShiftRight<1>(hn::BitCast(du, luma)));
  };
  const auto at = in_chroma(of);
  if constexpr (hn::MaxLanes(D16()) == kBlock) {
    return {hn::BitCast(d, hn::ConcatEven(d64, at, at)), hn::BitCast(d, hn::ConcatOdd(d64, at, at))};
  } else {
    const auto other = in_chroma(CellsOfPair(cells, pair, block, kHalf - lane));
    const auto low = lane ? other : at, high = lane ? at : other;
    return {hn::BitCast(d, hn::InterleaveLower(d64, low, high)), hn::BitCast(d, hn::InterleaveUpper(d64, low, high))};
  }
}

// Positions of the samples of a block's pair of rows where no window holds them: two rows and, in I420, their chroma.
inline void interpolate_cells(const SurfaceBand& cells, int pair, int block, bool i420, Positions out[3]) {
  const D16 d;
  const hn::CappedTag<int32_t, kBlock> d32;
  const hn::Rebind<uint16_t, decltype(d32)> du;
  constexpr int kTo15 = 15 - kPositionBits;
  const auto keep = [&](const FixedPositions& at, size_t lane, Positions& to) HWY_ATTR {
    alignas(64) uint16_t whole[kBlock];
    const auto split = [&](V16 v, int16_t* fraction, int32_t* to_whole) HWY_ATTR {
      hn::Store(hn::ShiftLeft<kTo15>(hn::And(v, hn::Set(d, (1 << kPositionBits) - 1))), d, fraction + lane);
      hn::Store(hn::ShiftRight<kPositionBits>(hn::BitCast(DU16(), v)), DU16(), whole);
      for (size_t i = 0; i < hn::Lanes(d); i += hn::Lanes(d32))
        hn::Store(hn::PromoteTo(d32, hn::Load(du, whole + i)), d32, to_whole + lane + i);
    };
    split(at.x, to.fx, to.column);
    split(at.y, to.fy, to.row);
  };
  for (size_t lane = 0; lane < kBlock; lane += hn::Lanes(d)) {
    const CellsOfPair of(cells, pair, block, lane);
    for (int row = 0; row < 2; row++) keep(luma_between(cells, of, pair, row, block, lane), lane, out[row]);
    if (i420) keep(chroma_between(cells, of, pair, block, lane), lane, out[2]);
  }
  const ptrdiff_t pitch = cells.pitch;
  for (int half = 0; half < 2; half++) {
    for (int row = 0; row < 2; row++)
      out[row].corner[half] = cells.luma_corner[(2 * pair + row) * pitch + 2 * block + half];
    out[2].corner[half] = cells.chroma_corner[pair * pitch / 2 + block];
  }
}

// Inverse distances of a block's samples in a row, those of chroma twice over. `half`: the block's first one in the
// view.
inline void inverse_along(const CellNodes& inverse, const CellRow& row, size_t half, bool chroma, float* out) {
  const hn::CappedTag<float, kHalf> d;
  const hn::Repartition<uint8_t, decltype(d)> d8;
  const InverseTable& table = chroma ? kChromaInverse : kLumaInverse;
  const hn::FixedTag<float, 4> d4;
  alignas(16) float nodes[2][4];  // the four nodes of each half
  for (size_t k = 0; k < 2; k++) {
    const auto between = [&](const std::vector<float>* rows) HWY_ATTR {
      const auto upper = hn::LoadU(d4, rows[row.k].data() + half + k);
      const auto lower = hn::LoadU(d4, rows[row.k + 1].data() + half + k);
      return hn::MulAdd(hn::Set(d4, row.t), hn::Sub(lower, upper), upper);
    };
    hn::Store(hn::InterleaveLower(d4, between(inverse.even), between(inverse.odd)), d4, nodes[k]);
  }
  for (size_t lane = 0; lane < (chroma ? kHalf : kBlock); lane += hn::Lanes(d)) {
    const size_t in_half = lane % kHalf;
    // Four samples of chroma to a half, eight of luma.
    auto four = hn::LoadDup128(d, nodes[chroma ? lane / 4 : lane / kHalf]);
    if (chroma && hn::Lanes(d) > 4) four = hn::ConcatUpperLower(d, hn::LoadDup128(d, nodes[1]), four);
    const auto look_up = [&](const uint8_t* at) HWY_ATTR {
      return hn::BitCast(d, hn::TableLookupBytes(hn::BitCast(d8, four), hn::LoadU(d8, at + 4 * in_half)));
    };
    const auto before = look_up(table.before);
    const auto s = hn::MulAdd(hn::LoadU(d, table.t + in_half), hn::Sub(look_up(table.after), before), before);
    hn::Store(s, d, out + lane);
    if (chroma) hn::Store(s, d, out + kHalf + lane);
  }
}

}  // namespace lf::simd::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();
#endif
