// SPDX-License-Identifier: LGPL-2.1-or-later
// Per target, see render_band.cc: where the nodes of a focal map lie in one camera's image, and what may be
// interpolated between them.
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

#include "render/simd/band_data.h"
#include "render/simd/positions-inl.h"

// Inverse distance is bilinear between four nodes of the map, a cell. Positions along one side of it, t = 0..1 from p0
// to p1, are p0 + t (p1 - p0) + t (1 - t) bend, where `bend` is what makes it exact in the middle. What is left:
//  - division: the exact one is p0 + t z1 / z(t) (p1 - p0), so t (1 - t) (1/2 - t) k^2 (p1 - p0) for k = |z1 - z0| / z;
//  - homogeneous camera coordinates have the product of the pixel's step a and the inverse distance's b as a quadratic
//    term, which division bends likewise: t (1 - t) (1/2 - t) k a b / z focal lengths;
//  - lens: t (t - 1/2) (t - 1) / 6 of its third derivative times |p1 - p0|^3.
// Sides down are bent for each node, and those along the rows between take their bend from the sides above and below:
// it is a product of two things that vary linearly, or nearly so.
HWY_BEFORE_NAMESPACE();
namespace lf::simd::HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

inline constexpr float kBeforeCell = -2.5f;   // the first node's place, pixels from the band's or the block's first
inline constexpr float kMostThird = 0.0482f;  // the largest value of t (1 - t) (1/2 - t)
// The largest value of t (1 - t) at pixels, which are at odd eighths of a cell.
inline constexpr float kMostBend = 15.f / 64;
// Largest relative change of depth along a side for which the above is good.
inline constexpr float kMostChange = 0.25f;

// Inverse distances at the map's nodes around a band's rows, over the whole view.
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
    const int inside = map.columns / 2;  // halves whose nodes are all there, after the first
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

// Positions at the nodes around the band's rows from y on, NaN where nothing is seen, and how the sides of cells bend.
// The first `ready` rows of nodes and those below them are there already.
inline void project_cells(const Slot& slot, const CellNodes& inverse, size_t first, size_t count, int y, int ready,
                          SurfaceBand& out, CellWork& work) {
  const hn::CappedTag<float, kBlock> d;
  using V = hn::Vec<decltype(d)>;
  const Projection projection(slot, slot.terms);
  const float top = static_cast<float>(y - slot.rect.y0 / kBandRows * kBandRows) + kBeforeCell;
  const auto half = hn::Set(d, 0.5f);
  const auto project = [&](V s, size_t i, float column, float row, V& x, V& y, V& z) HWY_ATTR {
    const auto at = hn::MulAdd(hn::Iota(d, static_cast<float>(i)), hn::Set(d, 2.f * kCell), hn::Set(d, column));
    V r2;
    projection.project(d, at, hn::Set(d, row), s, x, y, z, r2);
    const auto seen = hn::And(hn::Gt(z, hn::Zero(d)), hn::Le(r2, hn::Set(d, slot.max_r2)));
    x = hn::IfThenElse(seen, x, hn::NaN(d));
    y = hn::IfThenElse(seen, y, hn::NaN(d));
  };
  // The bend that makes the position in the middle between two others exact.
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

// Bounds what positions may be off by in a cell.
struct CellDoubt {
  explicit CellDoubt(const Slot& slot) {
    const float focal = std::max(slot.fx, slot.fy), least_focal = std::min(slot.fx, slot.fy);
    // |u| and |v| inside the image, with room for what a lens bends.
    const float reach = 1.5f / least_focal *
                        std::max(std::max(slot.cx, static_cast<float>(slot.image.width) - slot.cx),
                                 std::max(slot.cy, static_cast<float>(slot.image.height) - slot.cy));
    const auto product = [&](const float per[3]) {
      return kCell * focal * (std::max(std::abs(per[0]), std::abs(per[1])) + reach * std::abs(per[2]));
    };
    along = product(slot.terms.per_along);
    down = product(slot.terms.per_down);
    // Derivatives of r + k1 r^3 + k2 r^5 and of the tangential terms, per pixel.
    const float k1 = std::abs(slot.k1), k2 = std::abs(slot.k2), tangential = std::abs(slot.p1) + std::abs(slot.p2);
    second = ((8 * k1 + 24 * k2 * reach * reach) * reach + 6 * tangential) / least_focal;
    third = kMostThird / 6 * (6 * k1 + 60 * k2 * reach * reach) / (least_focal * least_focal);
  }
  template <class V>
  struct Side {
    V dx, dy, distance, change, doubt;
  };
  // The sides from the nodes at `i` of `from` to those at `j` of `to`, each with x, y, z, 1 / z and inverse distance.
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
    out.doubt = hn::Mul(hn::Mul(hn::Set(d, kMostThird), out.change), hn::MulAdd(out.change, out.distance, term));
    const auto cube = hn::Mul(out.distance, hn::Mul(out.distance, out.distance));
    out.doubt = hn::MulAdd(hn::Set(d, third), cube, out.doubt);
    out.doubt = hn::IfThenElse(hn::Lt(out.change, hn::Set(d, kMostChange)), out.doubt, hn::Set(d, 1.f));
    return out;
  }
  float along, down, second, third;
};

// Bounds what positions may be off by in each cell of the rows of cells from `ready` on.
inline void doubt_cells(const Slot& slot, const CellNodes& inverse, size_t first, size_t count, int ready,
                        const SurfaceBand& band, CellNodes& out) {
  const hn::CappedTag<float, kBlock> d;
  const CellDoubt bound(slot);
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
  // Two sides along rows, and how far their bends may be from linear between them.
  const auto between = [&](const auto& upper, const auto& lower) HWY_ATTR {
    const auto other = hn::Max(hn::Abs(hn::Sub(upper.dx, lower.dx)), hn::Abs(hn::Sub(upper.dy, lower.dy)));
    const auto change = hn::Max(upper.change, lower.change);
    const auto by_lens = hn::Mul(hn::Set(d, 0.5f * bound.second), other);
    return hn::MulAdd(hn::Mul(hn::Set(d, kMostBend * kMostBend), hn::Add(change, by_lens)), other,
                      hn::Max(upper.doubt, lower.doubt));
  };
  for (size_t i = 0; i < count; i += hn::Lanes(d)) {
    const auto even_to_odd = [&](int k)
                                 HWY_ATTR { return bound.side(d, rows[k].even, i, rows[k].odd, i, bound.along); };
    const auto odd_to_even = [&](int k)
                                 HWY_ATTR { return bound.side(d, rows[k].odd, i, rows[k].even, i + 1, bound.along); };
    auto upper_even = even_to_odd(ready), upper_odd = odd_to_even(ready);
    for (int k = ready; k + 1 < kCellRows; k++) {
      const auto lower_even = even_to_odd(k + 1), lower_odd = odd_to_even(k + 1);
      const auto left = bound.side(d, rows[k].even, i, rows[k + 1].even, i, bound.down).doubt;
      const auto middle = bound.side(d, rows[k].odd, i, rows[k + 1].odd, i, bound.down).doubt;
      const auto right = bound.side(d, rows[k].even, i + 1, rows[k + 1].even, i + 1, bound.down).doubt;
      hn::StoreU(hn::Add(between(upper_even, lower_even), hn::Max(left, middle)), d, out.even[k].data() + i);
      hn::StoreU(hn::Add(between(upper_odd, lower_odd), hn::Max(middle, right)), d, out.odd[k].data() + i);
      upper_even = lower_even;
      upper_odd = lower_odd;
    }
  }
}

}  // namespace lf::simd::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();
#endif
