// SPDX-License-Identifier: LGPL-2.1-or-later
// Included once per instruction set, see render_band.cc: sample positions in one camera's image for a view with a focal
// map. Projects the nodes of the map exactly, and finds the cells where interpolation is accurate enough. There, it
// interpolates the positions in fixed point. The terms are explained in sum_task.h.
#if defined(LF_RENDER_SIMD_CELLS_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef LF_RENDER_SIMD_CELLS_INL_H_
#undef LF_RENDER_SIMD_CELLS_INL_H_
#else
#define LF_RENDER_SIMD_CELLS_INL_H_
#endif

#include <algorithm>
#include <cmath>
#include <vector>

#include <hwy/highway.h>

#include "render/simd/samples-inl.h"
#include "render/simd/sum_task.h"
#include "render/sum_renderer.h"

// The interpolation and its errors. Inverse distance is bilinear in a cell, which lies between four nodes of the map.
// Positions along a side of a cell, from node p0 to node p1, are p0 + t (p1 - p0) + t (1 - t) bend with t = 0..1. The
// bend is chosen so that the middle is exact. Three errors remain:
//  - division: the exact position is p0 + t z1 / z(t) (p1 - p0), which adds t (1 - t) (1/2 - t) k^2 (p1 - p0) for
//    k = |z1 - z0| / z;
//  - homogeneous camera coordinates have a quadratic term, the product of the pixel step a and the inverse-distance
//    step b, which the division also bends: t (1 - t) (1/2 - t) k a b / z focal lengths;
//  - lens: t (t - 1/2) (t - 1) / 6 of its third derivative times |p1 - p0|^3.
// Lenses beyond the model OPENCV have larger errors, with further products of these terms. For a fisheye lens, z is the
// distance from the camera instead of the depth, because its positions are smooth functions of the direction of a
// point. See Bends.
// Vertical sides have a bend for each node. A row between two rows of nodes interpolates its bend linearly from the
// sides above and below, because the bend is a product of two nearly linear quantities.
HWY_BEFORE_NAMESPACE();
namespace lf::simd::HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

// position of the first node, pixels from the first pixel of the band or block
inline constexpr float kBeforeCell = -2.5f;
inline constexpr float kMaxThird = 0.0482f;  // maximum of t (1 - t) (1/2 - t)
// Maximum of t (1 - t) at pixels, which are at odd eighths of a cell.
inline constexpr float kMaxBend = 15.f / 64;
// The error bounds hold up to this relative change of depth along a side.
inline constexpr float kMaxChange = 0.25f;

// Looks up the inverse distances at the nodes of the map around a band, over the whole width of the view. The border
// nodes are repeated beyond the map. `y` is the first row of the band.
inline void place_nodes(const FocalMap& map, int y, int width, CellNodes& out) {
  const int halves = (width + kBlock - 1) / kBlock * 2 + 1;
  out.resize(static_cast<size_t>(halves) + 2 * kBlock);
  const auto scale = static_cast<float>((map.nearest - map.farthest) / FocalMap::kLevels);
  const auto far_end = static_cast<float>(map.farthest);
  for (int k = 0; k < kCellRows; k++) {
    const int j = std::clamp(y / kCell + k - 1, 0, map.rows - 1);
    const uint8_t* const row = map.levels.data() + static_cast<size_t>(j) * map.columns;
    const auto at = [&](int i) { return far_end + scale * static_cast<float>(row[std::clamp(i, 0, map.columns - 1)]); };
    float* __restrict const even = out.even[k].data();
    float* __restrict const odd = out.odd[k].data();
    const int inside = map.columns / 2;  // number of halves with all nodes inside the map, after the first
    even[0] = at(-1);
    odd[0] = at(0);
    for (int h = 1; h < inside; h++) {
      even[h] = far_end + scale * static_cast<float>(row[2 * h - 1]);
      odd[h] = far_end + scale * static_cast<float>(row[2 * h]);
    }
    for (int h = std::max(inside, 1); h < halves; h++) {
      even[h] = at(2 * h - 1);
      odd[h] = at(2 * h);
    }
  }
}

// Projects the nodes around a band into the camera's image, and computes the bends of the cell sides. `y` is the first
// row of the band. Positions of nodes that the camera cannot see are NaN. The first `ready` rows of nodes, and the
// sides below them, are still valid from the previous band.
inline void project_cells(const Slot& slot, const CellNodes& inverse, size_t first, size_t count, int y, int ready,
                          SurfaceBand& out, CellWork& work) {
  const hn::CappedTag<float, kBlock> d;
  using V = hn::Vec<decltype(d)>;
  const Projection projection(slot, slot.terms);
  const float top = static_cast<float>(y - slot.rect.y0 / kBandRows * kBandRows) + kBeforeCell;
  const auto half = hn::Set(d, 0.5f);
  // The compiler would not inline this large function, which takes 4 % of the time of a view.
  const auto project = [&](V s, size_t i, float column, float row, V& x, V& y, V& z) HWY_ATTR
      __attribute__((always_inline)) {
    const auto at = hn::MulAdd(hn::Iota(d, static_cast<float>(i)), hn::Set(d, 2.f * kCell), hn::Set(d, column));
    V reach;
    projection.project(d, at, hn::Set(d, row), s, x, y, z, reach);
    const auto seen = hn::And(hn::Gt(z, hn::Zero(d)), hn::Le(reach, hn::Set(d, slot.distortion.limit)));
    x = hn::IfThenElse(seen, x, hn::NaN(d));
    y = hn::IfThenElse(seen, y, hn::NaN(d));
  };
  // Returns the bend that makes the midpoint exact.
  const auto bend = [&](V middle, V from, V to)
                        HWY_ATTR { return hn::Mul(hn::Set(d, 4.f), hn::NegMulAdd(hn::Add(from, to), half, middle)); };
  constexpr float kEven = kBeforeCell, kOdd = kBeforeCell + kCell, kMiddle = kCell / 2.f;
  for (int k = ready; k < kCellRows; k++) {
    const float row = top + static_cast<float>(k * kCell);
    const int at = out.row(k);
    for (size_t i = 0; i < count; i += hn::Lanes(d)) {
      V x, y, z;
      project(hn::LoadU(d, inverse.even[k].data() + first + i), i, kEven, row, x, y, z);
      hn::StoreU(x, d, out.x.even[at].data() + i);
      hn::StoreU(y, d, out.y.even[at].data() + i);
      hn::StoreU(z, d, out.z.even[at].data() + i);
      hn::StoreU(hn::Div(hn::Set(d, 1.f), z), d, out.per_z.even[at].data() + i);
      project(hn::LoadU(d, inverse.odd[k].data() + first + i), i, kOdd, row, x, y, z);
      hn::StoreU(x, d, out.x.odd[at].data() + i);
      hn::StoreU(y, d, out.y.odd[at].data() + i);
      hn::StoreU(z, d, out.z.odd[at].data() + i);
      hn::StoreU(hn::Div(hn::Set(d, 1.f), z), d, out.per_z.odd[at].data() + i);
    }
  }
  for (int k = std::max(ready - 1, 0); k < kCellRows; k++) {
    const float row = top + static_cast<float>(k * kCell);
    const int at = out.row(k), below = out.row(k + 1);
    for (size_t i = 0; i < count; i += hn::Lanes(d)) {
      V x, y, z;
      const auto load = [&](const std::vector<float>& of, size_t n) HWY_ATTR { return hn::LoadU(d, of.data() + n); };
      const auto middle = [&](const std::vector<float>& a, size_t at_a, const std::vector<float>& b, size_t at_b)
                              HWY_ATTR { return hn::Mul(half, hn::Add(load(a, at_a), load(b, at_b))); };
      const auto& even_s = inverse.even[k];
      const auto& odd_s = inverse.odd[k];
      if (k + 1 < kCellRows) {
        project(middle(even_s, first + i, inverse.even[k + 1], first + i), i, kEven, row + kMiddle, x, y, z);
        hn::StoreU(bend(x, load(out.x.even[at], i), load(out.x.even[below], i)), d, work.down_x.even[k].data() + i);
        hn::StoreU(bend(y, load(out.y.even[at], i), load(out.y.even[below], i)), d, work.down_y.even[k].data() + i);
        project(middle(odd_s, first + i, inverse.odd[k + 1], first + i), i, kOdd, row + kMiddle, x, y, z);
        hn::StoreU(bend(x, load(out.x.odd[at], i), load(out.x.odd[below], i)), d, work.down_x.odd[k].data() + i);
        hn::StoreU(bend(y, load(out.y.odd[at], i), load(out.y.odd[below], i)), d, work.down_y.odd[k].data() + i);
      }
      if (k < ready) continue;
      project(middle(even_s, first + i, odd_s, first + i), i, kEven + kMiddle, row, x, y, z);
      hn::StoreU(bend(x, load(out.x.even[at], i), load(out.x.odd[at], i)), d, work.along_x.even[k].data() + i);
      hn::StoreU(bend(y, load(out.y.even[at], i), load(out.y.odd[at], i)), d, work.along_y.even[k].data() + i);
      project(middle(odd_s, first + i, even_s, first + i + 1), i, kOdd + kMiddle, row, x, y, z);
      hn::StoreU(bend(x, load(out.x.odd[at], i), load(out.x.even[at], i + 1)), d, work.along_x.odd[k].data() + i);
      hn::StoreU(bend(y, load(out.y.odd[at], i), load(out.y.even[at], i + 1)), d, work.along_y.odd[k].data() + i);
    }
  }
}

// Computes an upper bound of the interpolation error in a cell, in pixels of the image, from the errors listed above.
struct CellErrorBound {
  explicit CellErrorBound(const Slot& slot) {
    const float focal = std::max(slot.fx, slot.fy), least_focal = std::min(slot.fx, slot.fy);
    // u| and |v| inside the image, with a margin for lens distortion.
    const float reach = 1.5f / least_focal *
                        std::max(std::max(slot.cx, static_cast<float>(slot.image.width) - slot.cx),
                                 std::max(slot.cy, static_cast<float>(slot.image.height) - slot.cy));
    const auto product = [&](const float per[3]) {
      return kCell * focal * (std::max(std::abs(per[0]), std::abs(per[1])) + reach * std::abs(per[2]));
    };
    along = product(slot.terms.per_along);
    down = product(slot.terms.per_down);
    const Distortion<float>& of = slot.distortion;
    is_general = of.is_general;
    if (is_general) {
      const Bends bends(slot.steepness, of.fisheye);
      const float least = std::max(static_cast<float>(slot.steepness.least), 1e-6f) * least_focal;
      const auto norm = [](const float per[3]) { return std::hypot(per[0], per[1], per[2]); };
      const float scale = kCell * focal * bends.first, far = std::hypot(1.f, reach / least * least_focal);
      along = scale * norm(slot.terms.per_along) * (of.fisheye ? 1 : far);
      down = scale * norm(slot.terms.per_down) * (of.fisheye ? 1 : far);
      per_pixel = 1 / least;
      stretch = focal * bends.first * per_pixel;
      second = focal * bends.second * per_pixel * per_pixel;
      third = kMaxThird / 6 * focal * bends.third * per_pixel * per_pixel * per_pixel;
      return;
    }
    // Derivatives of r + k1 r^3 + k2 r^5 and of the tangential terms, per pixel.
    const float k1 = std::abs(of.k[0]), k2 = std::abs(of.k[1]), tangential = std::abs(of.p1) + std::abs(of.p2);
    second = ((8 * k1 + 24 * k2 * reach * reach) * reach + 6 * tangential) / least_focal;
    third = kMaxThird / 6 * (6 * k1 + 60 * k2 * reach * reach) / (least_focal * least_focal);
  }
  template <class V>
  struct Side {
    V dx, dy, distance, change, error_bound;
  };
  // Computes the bound for the sides between the nodes at `i` of `from` and the nodes at `j` of `to`. The five arrays
  // contain x, y, z, 1 / z and the inverse distance of the nodes.
  template <class D, class V = hn::Vec<D>>
  HWY_INLINE Side<V> side(D d, const float* const from[5], size_t i, const float* const to[5], size_t j,
                          float product) const {
    const auto difference = [&](int c) HWY_ATTR { return hn::Sub(hn::LoadU(d, to[c] + j), hn::LoadU(d, from[c] + i)); };
    const auto per_z = hn::Max(hn::LoadU(d, from[3] + i), hn::LoadU(d, to[3] + j));  // 1 / z of the nearer node
    Side<V> out;
    out.dx = difference(0);
    out.dy = difference(1);
    out.distance = hn::Max(hn::Abs(out.dx), hn::Abs(out.dy));
    out.change = hn::Mul(hn::Abs(difference(2)), per_z);
    const auto term = hn::Mul(hn::Mul(hn::Set(d, product), hn::Abs(difference(4))), per_z);
    out.error_bound = hn::Mul(hn::Mul(hn::Set(d, kMaxThird), out.change), hn::MulAdd(out.change, out.distance, term));
    if (is_general) {
      const auto angle = hn::Mul(hn::Set(d, per_pixel), out.distance);
      const auto more = hn::MulAdd(hn::Set(d, second), out.distance, hn::Mul(hn::Set(d, stretch), out.change));
      const auto by_lens = hn::MulAdd(hn::Mul(out.change, out.distance), more, hn::Mul(angle, term));
      out.error_bound = hn::MulAdd(hn::Set(d, kMaxThird), by_lens, out.error_bound);
      out.change = hn::Max(out.change, angle);
    }
    const auto cube = hn::Mul(out.distance, hn::Mul(out.distance, out.distance));
    out.error_bound = hn::MulAdd(hn::Set(d, third), cube, out.error_bound);
    out.error_bound = hn::IfThenElse(hn::Lt(out.change, hn::Set(d, kMaxChange)), out.error_bound, hn::Set(d, 1.f));
    return out;
  }
  float along, down, second, third;
  bool is_general;
  float per_pixel = 0,
        stretch = 1;  // only if is_general. per_pixel: largest change of (u, v) or of the angle per pixel
};

// Computes the bound of the position error for each cell, in the rows of cells from `ready` on.
inline void bound_cell_errors(const Slot& slot, const CellNodes& inverse, size_t first, size_t count, int ready,
                              const SurfaceBand& band, CellNodes& out) {
  const hn::CappedTag<float, kBlock> d;
  const CellErrorBound bound(slot);
  struct Row {
    const float *even[5], *odd[5];
  } rows[kCellRows];
  for (int k = 0; k < kCellRows; k++) {
    const int at = band.row(k);
    rows[k] = {{band.x.even[at].data(), band.y.even[at].data(), band.z.even[at].data(), band.per_z.even[at].data(),
                inverse.even[k].data() + first},
               {band.x.odd[at].data(), band.y.odd[at].data(), band.z.odd[at].data(), band.per_z.odd[at].data(),
                inverse.odd[k].data() + first}};
  }
  // Returns the bound for the upper and the lower side of a cell, including the error of interpolating the bend
  // linearly between both sides.
  const auto between = [&](const auto& upper, const auto& lower) HWY_ATTR {
    const auto other = hn::Max(hn::Abs(hn::Sub(upper.dx, lower.dx)), hn::Abs(hn::Sub(upper.dy, lower.dy)));
    const auto change = hn::Max(upper.change, lower.change);
    const auto by_lens = hn::Mul(hn::Set(d, 0.5f * bound.second), other);
    return hn::MulAdd(hn::Mul(hn::Set(d, kMaxBend * kMaxBend), hn::Add(change, by_lens)), other,
                      hn::Max(upper.error_bound, lower.error_bound));
  };
  for (size_t i = 0; i < count; i += hn::Lanes(d)) {
    const auto even_to_odd = [&](int k)
                                 HWY_ATTR { return bound.side(d, rows[k].even, i, rows[k].odd, i, bound.along); };
    const auto odd_to_even = [&](int k)
                                 HWY_ATTR { return bound.side(d, rows[k].odd, i, rows[k].even, i + 1, bound.along); };
    auto upper_even = even_to_odd(ready), upper_odd = odd_to_even(ready);
    for (int k = ready; k + 1 < kCellRows; k++) {
      const auto lower_even = even_to_odd(k + 1), lower_odd = odd_to_even(k + 1);
      const auto left = bound.side(d, rows[k].even, i, rows[k + 1].even, i, bound.down).error_bound;
      const auto middle = bound.side(d, rows[k].odd, i, rows[k + 1].odd, i, bound.down).error_bound;
      const auto right = bound.side(d, rows[k].even, i + 1, rows[k + 1].even, i + 1, bound.down).error_bound;
      hn::StoreU(hn::Add(between(upper_even, lower_even), hn::Max(left, middle)), d, out.even[k].data() + i);
      hn::StoreU(hn::Add(between(upper_odd, lower_odd), hn::Max(middle, right)), d, out.odd[k].data() + i);
      upper_even = lower_even;
      upper_odd = lower_odd;
    }
  }
}

#if HWY_TARGET != HWY_SCALAR

// The position of a row of the view between two rows of nodes: below row k of the nodes, by the fraction t of a cell.
struct CellRow {
  explicit CellRow(float y)
      : k(static_cast<int>((y - kBeforeCell) / kCell)), t((y - kBeforeCell) / kCell - static_cast<float>(k)) {}
  int k;
  float t;
};

// Rows are processed in pairs. The rows of a pair lie between the same two rows of nodes, so they share their cells.
// The upper row is at t = first_t(), the lower row a quarter of a cell below, and their chroma row halfway between
// these rows.
static_assert(kCell == 4 && kBandRows == 8);
inline constexpr int cell_of_pair(int pair) { return (pair + 1) / 2; }
inline constexpr float first_t(int pair) { return pair % 2 ? 0.125f : 0.625f; }

// Upper bound of the error of fixed-point arithmetic, in pixels. Nodes, steps and bends are each rounded, vertically
// and horizontally.
inline constexpr float kCellSlack = 4.f / (1 << kPositionBits);
inline constexpr float kMaxStep = kWindow - 1;  // pixels; limit of steps and bends, since 16 bits overflow at 16

// One coordinate (x or y) of the four nodes of a half-block in a row of nodes, with the bends of the cell sides.
template <class D, class V = hn::Vec<D>>
struct CellPiece {
  CellPiece(D d, const float* even, const float* odd, const float* even_bend, const float* odd_bend)
      : node{hn::LoadU(d, even), hn::LoadU(d, odd), hn::LoadU(d, even + 1), hn::LoadU(d, odd + 1)},
        bend{hn::LoadU(d, even_bend), hn::LoadU(d, odd_bend), hn::LoadU(d, even_bend + 1)} {}
  // Computes bounds of the positions of the samples. The first sample is at 5/8 of the first cell, the last at 3/8 of
  // the last cell. The bounds are NaN if steps or bends are too large, or if any node is NaN; the sum detects such
  // nodes, because Min and Max may ignore a NaN.
  HWY_INLINE void bounds(D d, V& low, V& high) const {
    const auto set = [d](float v) HWY_ATTR { return hn::Set(d, v); };
    const V step0 = hn::Sub(node[1], node[0]), step1 = hn::Sub(node[2], node[1]), step2 = hn::Sub(node[3], node[2]);
    const auto begin = hn::MulAdd(set(0.625f), step0, node[0]), end = hn::MulAdd(set(0.375f), step2, node[2]);
    const auto bends = hn::Max(hn::Max(hn::Abs(bend[0]), hn::Abs(bend[1])), hn::Abs(bend[2]));
    const auto most = hn::Max(hn::Max(hn::Abs(step0), hn::Abs(step1)), hn::Max(hn::Abs(step2), bends));
    const auto sum = hn::Add(hn::Add(hn::Add(node[0], node[1]), hn::Add(node[2], node[3])),
                             hn::Add(hn::Add(bend[0], bend[1]), bend[2]));
    const auto good = hn::And(hn::Lt(most, set(kMaxStep)), hn::Eq(sum, sum));
    const auto slack = hn::IfThenElse(good, hn::Mul(set(kMaxBend), bends), hn::NaN(d));
    low = hn::Sub(hn::Min(hn::Min(begin, end), hn::Min(node[1], node[2])), slack);
    high = hn::Add(hn::Max(hn::Max(begin, end), hn::Max(node[1], node[2])), slack);
  }
  V node[4], bend[3];
};

// Converts two values to fixed point modulo 2^16 and packs them into 32 bits. `magic` aligns the bits; see
// to_low_bits().
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

// Computes the input of the fixed-point interpolation in row k of the nodes (`nodes` and `along` of SurfaceBand), and
// the bounds of the samples.
inline void fix_nodes(const CellWork& work, int k, size_t halves, SurfaceBand& out) {
  const hn::CappedTag<float, kBlock> d;
  const int row = out.row(k);
  constexpr float kTurn = 1 << (16 - kPositionBits);  // fixed point wraps around after this, pixels
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
    // Positions are relative to a point near the first node: 16 bits do not cover an image.
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

// Computes the vertical bends (`down` of SurfaceBand) and the slack for the cells below row k of the nodes. The slack
// is NaN if the interpolation is not accurate enough there.
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
    const float *const even = work.error_bound.even[k].data() + i, *const odd = work.error_bound.odd[k].data() + i;
    // NaN fails every comparison, but Max may lose a NaN.
    const auto error_bound = hn::Add(hn::Max(hn::Max(hn::LoadU(d, even), hn::LoadU(d, odd)), hn::LoadU(d, even + 1)),
                                     hn::Mul(hn::Zero(d), hn::Add(sum(x), sum(y))));
    const auto good = hn::And(hn::Lt(error_bound, set(static_cast<float>(kGridError))), hn::Lt(largest, set(kMaxStep)));
    const auto slack = [&](V of) HWY_ATTR {
      return hn::IfThenElse(good, hn::MulAdd(set(kMaxBend), of, set(kCellSlack)), hn::NaN(d));
    };
    const size_t at = out.entry(k, i);
    hn::StoreU(slack(most_x), d, out.slack_x.data() + at);
    hn::StoreU(slack(most_y), d, out.slack_y.data() + at);
    const auto magic = set(kMagic);
    store_fixed(d, x, magic, y, magic, out.down.data() + 8 * at);
  }
}

// Marks half-blocks with a depth edge as not accurate enough, in the cells below row k of the nodes, which are row j of
// the view's cells. `first` is the index of the first half-block.
inline void exclude_edges(const DepthEdges& edges, int j, int k, size_t first, size_t halves, SurfaceBand& out) {
  if (j >= edges.rows) return;
  for (size_t i = 0; i < halves; i++) {
    bool has_edge = false;
    const int cell = static_cast<int>(2 * (first + i));
    for (int c = cell; c <= std::min(cell + 2, edges.columns - 1); c++)
      has_edge = has_edge || edges.index_of(c, j) >= 0;
    if (!has_edge) continue;
    out.slack_x[out.entry(k, i)] = out.slack_y[out.entry(k, i)] = NAN;
  }
}

// Constants for interpolating the samples of a half-block: which of the four nodes precedes each sample, and the
// distance from this node. A half-block has eight luma samples, with one table lookup each for x and y. It has four
// chroma samples, with a common lookup for x and y.
struct CellTable {
  // Shuffle indices that select the nodes before and after each sample, from a vector with the x of four nodes and the
  // y of four nodes in 16 bits.
  alignas(16) uint8_t before[kBlock], after[kBlock];
  alignas(16) int16_t t15[kHalf], bend15[kHalf];  // t and t (1 - t); 1 is 32768
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

// Constants for interpolating inverse distances in float between the four nodes of a half-block, for the slow path:
// shuffle indices as in CellTable, for 32-bit values, and t.
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

// Shuffle indices that repeat the origins of the two windows of a block for each node: x four times and y four times,
// for the first half-block and then for the second.
struct OriginTable {
  alignas(32) uint8_t at[2 * kBlock];
};
constexpr OriginTable make_origin_table() {
  OriginTable table{};
  for (int i = 0; i < 2 * kBlock; i++) table.at[i] = static_cast<uint8_t>(i / 16 * 4 + i % 16 / 8 * 2 + i % 2);
  return table;
}
inline constexpr OriginTable kOrigins = make_origin_table();

// The nodes above and below a pair of rows of a block, and the bends of the cell sides. Eight values belong to a
// half-block: the x of four nodes and the y of four nodes.
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

// Interpolates the positions of the samples in one row of a pair. The constructor interpolates vertically, from the
// nodes above and below to nodes in this row. Then at() interpolates along the row. The chroma row is halfway between
// both rows of the pair.
struct CellsOfRow {
  // `eighths` is the distance from the upper nodes down to the row, in eighths of a cell. `origin` contains the origin
  // of the window for each node.
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

// Returns the positions of the luma samples in row `row` (0 or 1) of a pair, relative to their windows. `of` are the
// nodes of the lanes that begin at `lane`.
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
// Returns the positions of the chroma samples of a pair, relative to their windows. `of` are the nodes of the lanes
// that begin at `lane`.
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

// Computes the positions of the samples in a pair of rows of a block, for gathering: luma of two rows and, in I420,
// their chroma. Used if the samples do not fit in windows.
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

// Interpolates the inverse distances at the samples of a block in one row. For chroma, the result has the same kHalf
// values twice. `half` is the index in the view of the block's first half-block.
inline void inverse_along(const CellNodes& inverse, const CellRow& row, size_t half, bool chroma, float* out) {
  const hn::CappedTag<float, kHalf> d;
  const hn::Repartition<uint8_t, decltype(d)> d8;
  const InverseTable& table = chroma ? kChromaInverse : kLumaInverse;
  const hn::FixedTag<float, 4> d4;
  alignas(16) float nodes[2][4];
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
    // four chroma samples per half, or eight luma samples
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

#endif

}  // namespace lf::simd::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();
#endif
