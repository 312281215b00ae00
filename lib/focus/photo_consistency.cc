// SPDX-License-Identifier: LGPL-2.1-or-later
#include "focus/photo_consistency.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <limits>
#include <type_traits>

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "focus/photo_consistency.cc"
#include <hwy/foreach_target.h>  // must precede highway.h
#include <hwy/highway.h>

#include "base/for_lanes-inl.h"

HWY_BEFORE_NAMESPACE();
namespace lf::HWY_NAMESPACE {

constexpr int kMissingWeight = PhotoConsistency::kWeightOne / 16;

void raise_to(const uint16_t* HWY_RESTRICT weight, int n, uint16_t* HWY_RESTRICT most) {
  map_lanes<uint16_t>(n, [&](auto d, int i) HWY_ATTR {
    hn::StoreU(hn::Max(hn::LoadU(d, most + i), hn::LoadU(d, weight + i)), d, most + i);
  });
}

// The size of a map, and the number of values from one row of nodes to the next.
struct Rows {
  int columns, rows, stride;
};

// Computes the deviation of each node (see PhotoConsistency::deviation()), and a count of 1 for a valid deviation. The
// results are 0 if the deviation is NaN or if the weight is much less than `most`, the largest weight of any hypothesis
// at the node.
void deviations(const PhotoConsistency& moments, const uint16_t* HWY_RESTRICT most, const Rows& of,
                float* HWY_RESTRICT out, float* HWY_RESTRICT count) {
  for (int y = 0; y < of.rows; y++, most += of.columns, out += of.stride, count += of.stride) {
    const size_t row = static_cast<size_t>(y) * of.columns;
    const uint16_t *weight = &moments.weight[row], *luma = &moments.luma[row], *square = &moments.square[row];
    map_lanes<float>(of.columns, [&](auto d, int i) HWY_ATTR {
      const hn::Rebind<uint16_t, decltype(d)> d16;
      const hn::Rebind<int32_t, decltype(d)> d32;
      const auto whole = [&](const uint16_t* from) HWY_ATTR { return hn::PromoteTo(d32, hn::LoadU(d16, from + i)); };
      const auto w16 = whole(weight);
      const auto w = hn::Mul(hn::ConvertTo(d, w16), hn::Set(d, 1.f / PhotoConsistency::kWeightOne));
      const auto enough = hn::Gt(hn::Add(w16, hn::Set(d32, kMissingWeight + 1)), whole(most));
      const auto seen = hn::And(hn::Ge(w, hn::Set(d, 0.5f)), hn::RebindMask(d, enough));
      const auto mean =
          hn::Div(hn::Mul(hn::ConvertTo(d, whole(luma)), hn::Set(d, 1.f / PhotoConsistency::kLumaOne)), w);
      const auto variance = hn::Sub(hn::Div(hn::ConvertTo(d, whole(square)), w), hn::Mul(mean, mean));
      const auto deviation = hn::Sqrt(hn::Max(variance, hn::Zero(d)));
      hn::StoreU(hn::IfThenElseZero(seen, deviation), d, out + i);
      hn::StoreU(hn::IfThenElseZero(seen, hn::Set(d, 1.f)), d, count + i);
    });
  }
}

// Applies a tent filter: sums 2 radius + 1 values, `step` apart, with linearly decreasing weights on both sides of the
// value at `from`.
void tent(const float* HWY_RESTRICT from, ptrdiff_t step, int radius, const Rows& of, float* HWY_RESTRICT out) {
  from -= radius * step;
  for (int y = 0; y < of.rows; y++, from += of.stride, out += of.stride)
    map_lanes<float>(of.columns, [&](auto d, int i) HWY_ATTR {
      auto sum = hn::LoadU(d, from + i);
      for (int k = 1; k <= 2 * radius; k++) {
        const auto part = hn::Set(d, static_cast<float>(HWY_MIN(k, 2 * radius - k) + 1));
        sum = hn::Add(sum, hn::Mul(part, hn::LoadU(d, from + i + k * step)));
      }
      hn::StoreU(sum, d, out + i);
    });
}

// Divides the filtered deviations by the filtered counts. The result is infinity where `counted` is 0. `out` has no
// gaps between rows.
void means(const float* HWY_RESTRICT sum, const float* HWY_RESTRICT count, const float* HWY_RESTRICT counted,
           const Rows& of, float* HWY_RESTRICT out) {
  for (int y = 0; y < of.rows; y++, out += of.columns) {
    const ptrdiff_t row = ptrdiff_t{y} * of.stride;
    map_lanes<float>(of.columns, [&](auto d, int i) HWY_ATTR {
      const auto there = hn::Gt(hn::LoadU(d, counted + row + i), hn::Zero(d));
      const auto mean = hn::Div(hn::LoadU(d, sum + row + i), hn::LoadU(d, count + row + i));
      hn::StoreU(hn::IfThenElse(there, mean, hn::Set(d, std::numeric_limits<float>::infinity())), d, out + i);
    });
  }
}

// Computes the costs of a hypothesis. `plane` points to temporary arrays, at the first node. Each has `radius` zeros
// around the nodes.
void costs_of(const PhotoConsistency& moments, const uint16_t* most, int radius, float* const plane[5], float* out) {
  const Rows of{moments.columns, moments.rows, moments.columns + 2 * radius};
  float *const value = plane[0], *const counted = plane[1], *const sums = plane[2], *const counts = plane[3];
  deviations(moments, most, of, value, counted);
  tent(value, 1, radius, of, sums);
  tent(counted, 1, radius, of, counts);
  tent(sums, of.stride, radius, of, value);
  tent(counts, of.stride, radius, of, plane[4]);
  means(value, plane[4], counted, of, out);
}

// Returns how many of n values are below the float with the bits `limit`. Non-negative floats have the same order as
// their bits as integers.
int count_below(const float* HWY_RESTRICT values, int n, int32_t limit) {
  const hn::ScalableTag<int32_t> all;
  auto counts = hn::Zero(all);
  int rest = 0;
  for_lanes<int32_t>(n, [&](auto d, int i) HWY_ATTR {
    const hn::Rebind<float, decltype(d)> df;
    const auto below = hn::Lt(hn::BitCast(d, hn::LoadU(df, values + i)), hn::Set(d, limit));
    if constexpr (std::is_same_v<decltype(d), hn::ScalableTag<int32_t>>)
      counts = hn::Sub(counts, hn::VecFromMask(d, below));
    else
      rest += static_cast<int>(hn::CountTrue(d, below));
  });
  return static_cast<int>(hn::GetLane(hn::SumOfLanes(all, counts))) + rest;
}

void compete(const float* HWY_RESTRICT cost, const float* HWY_RESTRICT lead, int hypothesis, int n,
             float* HWY_RESTRICT best, uint8_t* HWY_RESTRICT chosen) {
  for_lanes<float>(n, [&](auto d, int i) HWY_ATTR {
    const hn::Rebind<uint8_t, decltype(d)> d8;
    const hn::Rebind<int32_t, decltype(d)> d32;
    const auto behind = hn::Add(hn::LoadU(d, cost + i), hn::LoadU(d, lead + i)), before = hn::LoadU(d, best + i);
    const auto better = hn::Lt(behind, before);
    const auto was = hn::PromoteTo(d32, hn::LoadU(d8, chosen + i));
    hn::StoreU(hn::IfThenElse(better, behind, before), d, best + i);
    const auto is = hn::IfThenElse(hn::RebindMask(d32, better), hn::Set(d32, hypothesis), was);
    hn::StoreU(hn::DemoteTo(d8, is), d8, chosen + i);
  });
}

}  // namespace lf::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace lf {
namespace {

void add_saturated(uint16_t* sum, const uint16_t* values, size_t count) {
  for (size_t i = 0; i < count; i++) sum[i] = static_cast<uint16_t>(std::min(sum[i] + values[i], 65535));
}

}  // namespace

void PhotoConsistency::reset(int new_columns, int new_rows) {
  columns = new_columns;
  rows = new_rows;
  const size_t nodes = static_cast<size_t>(columns) * static_cast<size_t>(rows);
  for (std::vector<uint16_t>* sum : {&weight, &luma, &square}) sum->assign(nodes, 0);
}

void PhotoConsistency::add(const PhotoConsistency& part, int column, int row) {
  const auto width = static_cast<size_t>(part.columns);
  for (size_t y = 0; y < static_cast<size_t>(part.rows); y++) {
    const size_t to = (static_cast<size_t>(row) + y) * static_cast<size_t>(columns) + static_cast<size_t>(column);
    add_saturated(&weight[to], &part.weight[y * width], width);
    add_saturated(&luma[to], &part.luma[y * width], width);
    add_saturated(&square[to], &part.square[y * width], width);
  }
}

void PhotoConsistency::take_heavier(const PhotoConsistency& part, int column, int row) {
  for (int y = 0; y < part.rows; y++)
    for (int x = 0; x < part.columns; x++) {
      const size_t from = static_cast<size_t>(y) * part.columns + x;
      const size_t to = (static_cast<size_t>(row) + y) * columns + column + x;
      if (part.weight[from] <= weight[to]) continue;
      weight[to] = part.weight[from];
      luma[to] = part.luma[from];
      square[to] = part.square[from];
    }
}

float PhotoConsistency::deviation(size_t node) const {
  const float w = static_cast<float>(weight[node]) / kWeightOne;
  if (!(w >= 0.5f)) return std::numeric_limits<float>::quiet_NaN();
  const float mean = static_cast<float>(luma[node]) / kLumaOne / w;
  return std::sqrt(std::max(static_cast<float>(square[node]) / w - mean * mean, 0.f));
}

double moved_light(std::span<const PhotoConsistency> hypotheses, std::span<const uint8_t> chosen, size_t plane,
                   std::span<const uint8_t> counted) {
  constexpr int kAllWeight = PhotoConsistency::kWeightOne * 15 / 16;
  constexpr double kLuma = static_cast<double>(PhotoConsistency::kWeightOne) / PhotoConsistency::kLumaOne;
  constexpr int kMinNodes = 100;  // fewer nodes are dominated by objects at the border
  const PhotoConsistency& through = hypotheses[plane];
  double moved[4] = {};
  int nodes[4] = {};
  size_t i = 0;
  for (int y = 0; y < through.rows; y++)
    for (int x = 0; x < through.columns; x++, i++) {
      const PhotoConsistency& surface = hypotheses[chosen[i]];
      if (!counted.empty() && !counted[i]) continue;
      if (surface.weight[i] < kAllWeight || through.weight[i] < kAllWeight) continue;
      const int quarter = 2 * (2 * y / through.rows) + 2 * x / through.columns;
      moved[quarter] += kLuma * (static_cast<double>(surface.luma[i]) / surface.weight[i] -
                                 static_cast<double>(through.luma[i]) / through.weight[i]);
      nodes[quarter]++;
    }
  double squares = 0;
  int all = 0;
  for (int q = 0; q < 4; q++) {
    if (nodes[q] < kMinNodes) continue;
    squares += moved[q] * moved[q] / nodes[q];
    all += nodes[q];
  }
  return all > 0 ? squares / all : 0;
}

namespace {

HWY_EXPORT(raise_to);
HWY_EXPORT(costs_of);
HWY_EXPORT(count_below);
HWY_EXPORT(compete);

}  // namespace

std::vector<std::vector<float>> hypothesis_costs(std::span<const PhotoConsistency> moments, int radius) {
  std::vector<uint16_t> most(moments[0].weight);
  for (const PhotoConsistency& m : moments.subspan(1))
    HWY_DYNAMIC_DISPATCH(raise_to)(m.weight.data(), static_cast<int>(most.size()), most.data());
  const int stride = moments[0].columns + 2 * radius, rows = moments[0].rows + 2 * radius;
  const size_t size = static_cast<size_t>(stride) * static_cast<size_t>(rows);
  std::vector<float> memory(5 * size);
  float* plane[5];
  for (size_t i = 0; i < 5; i++) plane[i] = memory.data() + i * size + radius * stride + radius;
  std::vector<std::vector<float>> costs;
  for (const PhotoConsistency& m : moments)
    HWY_DYNAMIC_DISPATCH(costs_of)(m, most.data(), radius, plane, costs.emplace_back(most.size()).data());
  return costs;
}

double median_of_finite(std::span<const float> values) {
  const auto below = [&](int32_t bits) {
    return HWY_DYNAMIC_DISPATCH(count_below)(values.data(), static_cast<int>(values.size()), bits);
  };
  const int finite = below(std::bit_cast<int32_t>(std::numeric_limits<float>::infinity()));
  if (finite == 0) return std::numeric_limits<double>::quiet_NaN();
  // Determines the bits of the median from the highest: the largest number such that at most half of the values are
  // below.
  int32_t bits = 0;
  for (int32_t bit = 1 << 30; bit != 0; bit >>= 1)
    if (below(bits | bit) <= finite / 2) bits |= bit;
  return std::bit_cast<float>(bits);
}

void cheapest_hypotheses(std::span<const std::vector<float>> costs, std::span<const float> lead, float* best,
                         uint8_t* chosen) {
  std::ranges::copy(costs[0], best);
  std::fill_n(chosen, costs[0].size(), uint8_t{0});
  for (size_t t = 1; t < costs.size(); t++) HWY_DYNAMIC_DISPATCH(compete)
  (costs[t].data(), lead.data(), static_cast<int>(t), static_cast<int>(costs[t].size()), best, chosen);
}

}  // namespace lf
#endif
