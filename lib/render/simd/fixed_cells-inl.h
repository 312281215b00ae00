// SPDX-License-Identifier: LGPL-2.1-or-later
// Per target, see render_band.cc: positions at the nodes of a focal map in fixed point, and what bounds those between
// them.
#if defined(LF_RENDER_SIMD_FIXED_CELLS_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef LF_RENDER_SIMD_FIXED_CELLS_INL_H_
#undef LF_RENDER_SIMD_FIXED_CELLS_INL_H_
#else
#define LF_RENDER_SIMD_FIXED_CELLS_INL_H_
#endif

#include <vector>

#include <hwy/highway.h>

#include "render/simd/band_data.h"
#include "render/simd/cells-inl.h"
#include "render/simd/positions-inl.h"
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

// Pixels that fixed point may be off by: nodes, steps and bends are rounded, both down and along.
inline constexpr float kCellSlack = 4.f / (1 << kPositionBits);
inline constexpr float kMostStep = kWindow - 1;  // pixels from node to node, and of bends: 16 is where 16 bits end

// One coordinate of a half at a row of nodes: the nodes around it, and how positions bend between them.
template <class D, class V = hn::Vec<D>>
struct CellPiece {
  CellPiece(D d, const float* even, const float* odd, const float* even_bend, const float* odd_bend)
      : node{hn::LoadU(d, even), hn::LoadU(d, odd), hn::LoadU(d, even + 1), hn::LoadU(d, odd + 1)},
        bend{hn::LoadU(d, even_bend), hn::LoadU(d, odd_bend), hn::LoadU(d, even_bend + 1)} {}
  // Bounds of the samples, the first of which is at 5/8 of the first cell and the last at 3/8 of the last one. They are
  // NaN where any node is, which Min and Max may lose, or where steps are too large.
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

// Makes the fixed-point nodes, and the bounds of samples, at row k of nodes.
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
    // Positions count from near the first node: there are not bits enough for all of an image.
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

// Makes the bends down, and the slack, of the cells below row k of nodes.
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
    const auto good = hn::And(hn::Lt(doubt, set(static_cast<float>(kGridError))), hn::Lt(largest, set(kMostStep)));
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

}  // namespace lf::simd::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();
#endif
