// SPDX-License-Identifier: LGPL-2.1-or-later
#include "focus/depth_ambiguity.h"

#include <array>
#include <cmath>
#include <limits>
#include <utility>

namespace lf {
namespace {

constexpr float kInfinity = std::numeric_limits<float>::infinity();
constexpr int kAllWeight = PhotoConsistency::kWeightOne * 15 / 16;

float luma_at(const PhotoConsistency& moments, size_t node) {
  constexpr float kLuma = static_cast<float>(PhotoConsistency::kWeightOne) / PhotoConsistency::kLumaOne;
  return kLuma * static_cast<float>(moments.luma[node]) / static_cast<float>(moments.weight[node]);
}

float squared(float value) { return value * value; }

// Returns how plausible a depth with the deviation `other` is, compared with a depth with the deviation `cost`: at most
// 1, which means as plausible. The plausibility decreases slowly, because even cameras that see the same point can
// deviate strongly, above all near silhouettes. One level of luma is noise.
float plausible(float other, float cost) {
  const float part = (squared(cost) + 1) / (squared(other) + 1);
  return part < 1 ? part * std::sqrt(part) : 1;
}

}  // namespace

bool DepthAmbiguity::is_from(const View& view) const {
  return view.pose == view_.pose && view.lens == view_.lens && view.width == view_.width &&
         view.height == view_.height && view.focus.map->levels.size() == nodes_.size();
}

void DepthAmbiguity::add(const View& view, std::span<const std::vector<uint8_t>> levels,
                         std::span<const PhotoConsistency> moments, const Sweep& of) {
  const FocalMap& map = *view.focus.map;
  const size_t count = levels.size();
  if (!is_from(view)) {
    view_ = view;
    view_.focus.map = nullptr;
    nodes_.assign(map.levels.size(), {{0, kInfinity, 0}, {0, kInfinity, 0}, NAN});
  }
  const std::vector<std::vector<float>> costs = hypothesis_costs(moments.first(count), 1);
  const auto apart = static_cast<float>(apart_);
  std::vector<Depth> depths(count + 2);
  for (size_t i = 0; i < nodes_.size(); i++) {
    Node& node = nodes_[i];
    if (moments[of.plane].weight[i] >= kAllWeight) node.on_plane = luma_at(moments[of.plane], i);
    size_t n = 0;
    depths[n++] = node.best;
    depths[n++] = node.other;
    for (size_t t = of.first; t < count; t++)
      if (costs[t][i] < kInfinity && moments[t].weight[i] >= kAllWeight)
        depths[n++] = {static_cast<float>(map.inverse_of(levels[t][i])), costs[t][i], luma_at(moments[t], i)};
    for (size_t k = 0; k < n; k++)
      if (depths[k].cost < node.best.cost) node.best = depths[k];
    Depth other{0, kInfinity, 0};
    for (size_t k = 0; k < n; k++)
      if (depths[k].cost < other.cost && std::abs(depths[k].inverse - node.best.inverse) > apart) other = depths[k];
    node.other = other;
  }
}

void DepthAmbiguity::forget_beyond(double farthest, double nearest) {
  const auto is_beyond = [&](const Depth& depth) { return !(depth.inverse >= farthest && depth.inverse <= nearest); };
  for (Node& node : nodes_) {
    if (is_beyond(node.other)) node.other.cost = kInfinity;
    if (is_beyond(node.best)) node.best = std::exchange(node.other, {0, kInfinity, 0});
  }
}

DepthAmbiguity::Errors DepthAmbiguity::errors(const View& view, std::span<const uint8_t> levels,
                                              const PhotoConsistency& surface, const PhotoConsistency& plane) const {
  Errors errors;
  if (nodes_.empty() || !is_from(view)) return errors;
  // If luma through the viewer's plane has changed by more than exposure compensation can, the node shows another
  // object than during add().
  constexpr float kChanged = 0.125f, kNoise = 2;
  const std::array<PhotoConsistency, 2> both{surface, plane};
  const std::vector<std::vector<float>> costs = hypothesis_costs(both, 1);
  const auto apart = static_cast<float>(apart_);
  size_t known = 0, seen = 0;
  for (size_t i = 0; i < nodes_.size(); i++) {
    const Node& node = nodes_[i];
    seen += surface.weight[i] > 0 || plane.weight[i] > 0;
    if (!(costs[0][i] < kInfinity) || surface.weight[i] < kAllWeight || plane.weight[i] < kAllWeight) continue;
    const float through = luma_at(surface, i), on_plane = luma_at(plane, i);
    if (!(std::abs(on_plane - node.on_plane) < kChanged * node.on_plane + kNoise)) continue;
    const auto inverse = static_cast<float>(view.focus.map->inverse_of(levels[i]));
    const bool is_best = std::abs(node.best.inverse - inverse) > apart;
    const Depth& other = is_best ? node.best : node.other;
    float part = 0;
    if (other.cost < kInfinity && std::abs(other.inverse - inverse) > apart) part = plausible(other.cost, costs[0][i]);
    const float brighter = node.on_plane > kNoise ? on_plane / node.on_plane : 1, luma = brighter * other.luma;
    const float of_surface = squared(surface.deviation(i)), of_plane = squared(plane.deviation(i));
    errors.surface += part * squared(through - luma) + (1 - part) * of_surface;
    errors.plane += part * squared(on_plane - luma) + (1 - part) * of_plane;
    errors.surface_disagrees += of_surface;
    errors.plane_disagrees += of_plane;
    known++;
  }
  if (known == 0) return errors;
  errors.known = static_cast<double>(known) / static_cast<double>(seen);
  for (double* sum : {&errors.surface, &errors.plane, &errors.surface_disagrees, &errors.plane_disagrees})
    *sum /= static_cast<double>(known);
  return errors;
}

}  // namespace lf
