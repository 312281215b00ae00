// SPDX-License-Identifier: LGPL-2.1-or-later
#include "focus/warp_depth_map.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <utility>

#include "focus/depth_selection.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "focus/warp_depth_map.cc"
#include <hwy/foreach_target.h>  // must precede highway.h
#include <hwy/highway.h>

#include "base/for_lanes-inl.h"
#include "geometry/distort-inl.h"

HWY_BEFORE_NAMESPACE();
namespace lf::HWY_NAMESPACE {

// Computes the range [first, past) of nodes that a footprint covers, along one axis of a map with `count` nodes. It
// covers the nodes with centres within `size` around `middle`, and the node that contains `middle`.
template <class D>
HWY_INLINE void span_of(D d, hn::Vec<D> middle, hn::Vec<D> size, double count, hn::Mask<D> seen, int32_t* first,
                        int32_t* past) {
  const hn::Rebind<int32_t, D> d32;
  const auto inside = [&](hn::Vec<D> at) HWY_ATTR { return hn::Min(hn::Max(at, hn::Zero(d)), hn::Set(d, count)); };
  const auto half = hn::Set(d, 0.5), reach = hn::Mul(size, half);
  const auto begin = hn::Ceil(inside(hn::Sub(hn::Sub(middle, reach), half)));
  const auto end = hn::Max(hn::Sub(hn::Add(middle, reach), half), middle);
  const auto store = [&](hn::Vec<D> at, int32_t* to) HWY_ATTR {
    hn::StoreU(hn::DemoteTo(d32, hn::IfThenElseZero(seen, at)), d32, to);  // floor(), as no value is negative
  };
  store(hn::Min(begin, inside(middle)), first);
  store(inside(hn::Add(end, hn::Set(d, 1.0))), past);
}

void carry_row(const WarpedNodes::Geometry& of, const double* HWY_RESTRICT u_row, const double* HWY_RESTRICT v_row,
               const uint8_t* HWY_RESTRICT levels, int n, int32_t* HWY_RESTRICT left, int32_t* HWY_RESTRICT right,
               int32_t* HWY_RESTRICT top, int32_t* HWY_RESTRICT bottom) {
  map_lanes<double>(n, [&](auto d, int i) HWY_ATTR {
    const hn::Rebind<uint8_t, decltype(d)> d8;
    const hn::Rebind<int32_t, decltype(d)> d32;
    const auto set = [&](double value) HWY_ATTR { return hn::Set(d, value); };
    const auto u = hn::LoadU(d, u_row + i), v = hn::LoadU(d, v_row + i);
    const auto times = [&](const double* row) HWY_ATTR {
      return hn::Add(hn::Add(hn::Mul(set(row[0]), u), hn::Mul(set(row[1]), v)), set(row[2]));
    };
    const auto level = hn::PromoteTo(d, hn::PromoteTo(d32, hn::LoadU(d8, levels + i)));
    const auto inverse = hn::Add(set(of.farthest), hn::Mul(set(of.range), hn::Div(level, set(FocalMap::kLevels))));
    // The same formula as in CameraProjection, where infinity is no special case.
    const auto before = hn::Sub(set(1), hn::Mul(inverse, set(of.eye))), along = hn::Mul(inverse, times(of.normal));
    const auto moved = [&](int k) HWY_ATTR {
      return hn::Add(hn::Mul(before, times(of.to_from_view + 3 * k)), hn::Mul(along, set(of.offset[k])));
    };
    // Depths in a view are positive.
    const auto depth = moved(2);
    auto x = moved(0), y = moved(1), z = depth;
    const auto reach = through_lens<false>(d, of.distortion, of.is_distorted, x, y, z);
    auto seen = hn::Gt(depth, hn::Zero(d));
    if (of.is_distorted) seen = hn::And(seen, hn::Le(reach, set(of.distortion.limit)));
    const auto larger = hn::Div(hn::Mul(set(of.zoom), before), depth);
    const auto node = [&](auto at, double f, double c) HWY_ATTR {
      return hn::Mul(hn::Add(hn::Add(hn::Mul(set(f), at), set(c)), set(0.5)), set(of.per_step));
    };
    span_of(d, node(x, of.fx, of.cx), larger, of.columns, seen, left + i, right + i);
    span_of(d, node(y, of.fy, of.cy), larger, of.rows, seen, top + i, bottom + i);
  });
}

}  // namespace lf::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace lf {

HWY_EXPORT(carry_row);

WarpedNodes::WarpedNodes(const View& from, const View& to, int columns, int rows) : from_(from) {
  const FocalMap& map = *from.focus.map;
  const Mat3 to_from_view = glm::transpose(to.pose.rotation()) * from.pose.rotation();
  const Vec3 offset = glm::transpose(to.pose.rotation()) * (from.pose.position - to.pose.position);
  const Vec3 normal = glm::transpose(from.pose.rotation()) * map.from.normal;
  for (int k = 0; k < 3; k++) {
    for (int column = 0; column < 3; column++) geometry_.to_from_view[3 * k + column] = to_from_view[column][k];
    geometry_.offset[k] = offset[k];
    geometry_.normal[k] = normal[k];
  }
  geometry_.eye = map.from.signed_distance(from.pose.position);
  geometry_.farthest = map.farthest;
  geometry_.range = map.nearest - map.farthest;
  const Lens& lens = to.lens;
  geometry_.fx = lens.fx();
  geometry_.fy = lens.fy();
  geometry_.cx = lens.cx();
  geometry_.cy = lens.cy();
  geometry_.distortion = lens.distortion();
  geometry_.is_distorted = lens.has_distortion();
  geometry_.zoom = lens.fx() / from.lens.fx();
  geometry_.per_step = 1 / static_cast<double>(map.step);
  geometry_.columns = columns;
  geometry_.rows = rows;
  for (std::vector<double>* of_row : {&u_, &v_}) of_row->resize(map.columns);
  for (std::vector<int32_t>* of_row : {&left_, &right_, &top_, &bottom_}) of_row->resize(map.columns);
}

WarpedNodes::Row WarpedNodes::row(int j) {
  const FocalMap& map = *from_.focus.map;
  const double step = map.step, middle = (step - 1) / 2;
  for (int i = 0; i < map.columns; i++) {
    if (j > 0 && !from_.lens.has_distortion()) {  // columns keep their u
      std::fill(v_.begin(), v_.end(), (step * j + middle - from_.lens.cy()) / from_.lens.fy());
      break;
    }
    const std::optional<Vec2> ray = from_.lens.unproject({step * i + middle, step * j + middle});
    u_[i] = ray ? ray->x : std::numeric_limits<double>::quiet_NaN();  // not visible
    v_[i] = ray ? ray->y : 0;
  }
  HWY_DYNAMIC_DISPATCH(carry_row)
  (geometry_, u_.data(), v_.data(), &map.levels[static_cast<size_t>(j) * map.columns], map.columns, left_.data(),
   right_.data(), top_.data(), bottom_.data());
  return {left_.data(), right_.data(), top_.data(), bottom_.data()};
}

namespace {

constexpr int kHole = -1;

// Fills the holes of a row with the farther of the two levels beside the hole. Returns false if the row consists of
// holes only.
bool fill_row(int* row, int columns) {
  const int* const end = row + columns;
  if (std::all_of(row, const_cast<int*>(end), [](int v) { return v == kHole; })) return false;
  for (int i = 0; i < columns;) {
    if (row[i] != kHole) {
      i++;
      continue;
    }
    int past = i;
    while (past < columns && row[past] == kHole) past++;
    const int before = i > 0 ? row[i - 1] : kHole, after = past < columns ? row[past] : kHole;
    const int level = before == kHole ? after : after == kHole ? before : std::min(before, after);
    std::fill(row + i, row + past, level);
    i = past;
  }
  return true;
}

}  // namespace

std::shared_ptr<const FocalMap> warp_depth_map(const View& from, const View& to) {
  const std::shared_ptr<const FocalMap>& map = from.focus.map;
  if (from.pose == to.pose && from.lens == to.lens && from.width == to.width && from.height == to.height) return map;
  auto carried = std::make_shared<FocalMap>(*map);
  carried->columns = FocalMap::nodes(to.width, map->step);
  carried->rows = FocalMap::nodes(to.height, map->step);
  const size_t nodes = static_cast<size_t>(carried->columns) * static_cast<size_t>(carried->rows);
  if (nodes > FocalMap::kMaxNodes) return nullptr;
  std::vector<int> levels(nodes, kHole);

  WarpedNodes nodes_of(from, to, carried->columns, carried->rows);
  for (int j = 0; j < map->rows; j++) {
    const WarpedNodes::Row row = nodes_of.row(j);
    const uint8_t* const row_levels = &map->levels[static_cast<size_t>(j) * map->columns];
    for (int i = 0; i < map->columns; i++)
      for (int y = row.top[i]; y < row.bottom[i]; y++)
        for (int x = row.left[i]; x < row.right[i]; x++) {
          int& there = levels[static_cast<size_t>(y) * carried->columns + x];
          there = std::max<int>(there, row_levels[i]);
        }
  }

  std::vector<int> filled(carried->rows);
  for (int j = 0; j < carried->rows; j++)
    filled[j] = fill_row(levels.data() + static_cast<size_t>(j) * carried->columns, carried->columns);
  for (int j = 0; j < carried->rows; j++) {
    if (filled[j]) continue;
    // A row without any content is a copy of the nearest row with content. If there is no such row, all nodes are at
    // the farthest depth.
    int nearest = kHole;
    for (int k = 0; k < carried->rows; k++)
      if (filled[k] && (nearest == kHole || std::abs(k - j) < std::abs(nearest - j))) nearest = k;
    const auto row = [&](int k) { return levels.begin() + static_cast<ptrdiff_t>(k) * carried->columns; };
    if (nearest == kHole)
      std::fill(row(j), row(j + 1), 0);
    else
      std::copy(row(nearest), row(nearest + 1), row(j));
  }
  carried->levels.assign(nodes, 0);
  std::transform(levels.begin(), levels.end(), carried->levels.begin(),
                 [](int level) { return static_cast<uint8_t>(level); });
  return carried;
}

void LatestSurface::leaves(const std::vector<DepthHypothesis>& hypotheses, uint32_t sequence) {
  underway_.push_back({hypotheses, rounds_, sequence});
  if (underway_.size() <= kMaxInFlight) return;
  lost_.push_back(std::move(underway_.front().hypotheses));
  underway_.pop_front();
}

// Removes and returns the entry of an answered request. Returns nothing if the request is unknown. Requests are
// answered in order, so earlier entries count as lost.
std::optional<LatestSurface::Underway> LatestSurface::answered(const ViewRequest& request) {
  const auto left = std::ranges::find(underway_, request.hypotheses, &Underway::hypotheses);
  if (left == underway_.end()) return std::nullopt;
  for (auto before = underway_.begin(); before != left; before++) lost_.push_back(std::move(before->hypotheses));
  const Underway found = std::move(*left);
  underway_.erase(underway_.begin(), left + 1);
  const uint32_t took = request.sequence - found.sequence;  // sequence numbers wrap
  if (took < kMaxInFlight) longest_ = std::max(longest_.value_or(0), took);
  return found;
}

void LatestSurface::lose(const ViewRequest& request) {
  if (answered(request)) lost_.push_back(request.hypotheses);
}

std::vector<std::vector<DepthHypothesis>> LatestSurface::take_lost(uint32_t sequence) {
  const uint32_t most = kMaxInFlight, patience = longest_ ? std::min(2 * *longest_ + kPatience, most) : most;
  while (!underway_.empty() && sequence - underway_.front().sequence > patience) {
    lost_.push_back(std::move(underway_.front().hypotheses));
    underway_.pop_front();
  }
  return std::exchange(lost_, {});
}

std::shared_ptr<const FocalMap> LatestSurface::seen_from(const View& view) const {
  return view_.focus.map ? warp_depth_map(view_, view) : nullptr;
}

void LatestSurface::merge(const ViewRequest& request, const DepthSelection& choice, FocalMap& map) {
  const std::optional<Underway> left = answered(request);
  const unsigned known = left ? left->rounds : rounds_;
  std::shared_ptr<const FocalMap> before;
  if (known < rounds_) before = seen_from(request.view);
  if (before && (before->farthest != map.farthest || before->nearest != map.nearest)) {
    auto same_range = std::make_shared<FocalMap>(*before);
    set_range({map.farthest, map.nearest}, *same_range);
    before = std::move(same_range);
  }
  rounds_++;
  const size_t nodes = map.levels.size();
  if (before && before->levels.size() != nodes) before.reset();
  if (cost_.size() != nodes) {
    before.reset();
    cost_.assign(nodes, std::numeric_limits<float>::infinity());
    moved_.assign(nodes, 0);
  }
  for (size_t i = 0; i < nodes; i++) {
    if (before && moved_[i] > known && cost_[i] <= choice.least[i] + choice.lead[i]) {
      map.levels[i] = before->levels[i];
      continue;
    }
    cost_[i] = choice.least[i];
    if (choice.chosen[i] != 0) moved_[i] = rounds_;
  }
}

}  // namespace lf
#endif
