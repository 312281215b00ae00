// SPDX-License-Identifier: LGPL-2.1-or-later
#include "focus/autofocus.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "focus/focus_array.h"
#include "focus/hypothesis_levels.h"

namespace lf {
namespace {

constexpr double kNearestMeant = 0.3;  // nearest depth of the first stage, as a fraction of the focus distance
constexpr double kAround = 1.5;        // range of the second stage: factor towards near and far
constexpr int kSweptPlanes = static_cast<int>(kMaxHypotheses) - 1;
constexpr double kFarFocus = 3;  // the focus does not limit the search if it is this much farther than the reach
constexpr double kInside = 0.9;  // a result is inside the range up to this fraction of kAround - 1
constexpr double kFarthestApart = FocalMap::kMinStep / 2.0;  // largest distance of planes; pixels of disparity

}  // namespace

std::optional<double> focus_distance_at(const View& view, const Vec2& pixel) {
  const FocalMap& map = *view.focus.map;
  const int column = static_cast<int>(std::clamp(pixel.x / map.step, 0.0, map.columns - 1.0));
  const int row = static_cast<int>(std::clamp(pixel.y / map.step, 0.0, map.rows - 1.0));
  std::array<uint8_t, 9> levels;
  size_t count = 0;
  for (int j = std::max(row - 1, 0); j <= std::min(row + 1, map.rows - 1); j++)
    for (int i = std::max(column - 1, 0); i <= std::min(column + 1, map.columns - 1); i++)
      levels[count++] = map.levels[static_cast<size_t>(j) * map.columns + i];
  std::nth_element(levels.begin(), levels.begin() + count / 2, levels.begin() + count);
  const double inverse = map.inverse_of(levels[count / 2]);
  const std::optional<Vec2> ray = view.lens.unproject(pixel);
  if (!ray || !(inverse > 0)) return std::nullopt;
  const Vec3 normal = glm::transpose(view.pose.rotation()) * map.from.normal;
  // As in ViewPlan: (normal . d) t = 1 / inverse - eye distance. t is the distance along the axis because d.z = 1.
  const double t = (1 / inverse - map.from.signed_distance(view.pose.position)) / glm::dot(normal, Vec3(*ray, 1));
  if (!(t > 0) || !std::isfinite(t)) return std::nullopt;
  return t;
}

View view_around(const View& view, const Vec2& pixel) {
  View around = view;
  around.width = around.height = kSweptPixels;
  around.lens = view.lens.shifted(Vec2((kSweptPixels - 1) / 2.0) - pixel);
  around.focus.map = nullptr;
  return around;
}

void add_focus_sweep(ViewRequest& request, const Plane& from, std::optional<double> found, double reach) {
  View& view = request.view;
  const double eye = from.signed_distance(view.pose.position);
  const double along = glm::dot(from.normal, view.pose.forward());
  double nearest, farthest;
  if (found) {
    const double distance = std::max(eye + *found * along, 1e-9);
    nearest = kAround / distance;
    farthest = 1 / (kAround * distance);
  } else {
    const double focused = plane_inverse(view, from, {0, 0, 1});
    nearest = (focused > 0 ? focused : 1) / kNearestMeant;
    if (nearest < reach / kFarFocus) nearest = reach;
    farthest = 0;
  }
  view.focus.map = std::make_shared<FocalMap>(plane_map(view, from, nearest, farthest));
  request.hypotheses = {{DepthHypothesis::Kind::kBlurred, 0}};
  for (int k = 0; k < kSweptPlanes; k++)
    request.hypotheses.push_back({DepthHypothesis::Kind::kPlane, static_cast<int16_t>(255 * (k + 1) / kSweptPlanes)});
}

double sweep_reach(const Rig& rig, const View& view) {
  const double pixels = FocusArray(rig).spacing() * view.lens.fx();  // disparity of neighbouring cameras per 1/m
  return pixels > 0 ? kSweptPlanes * kFarthestApart / pixels : 0;
}

bool is_inside_sweep(double distance, double found) {
  const double factor = std::max(distance / found, found / distance);
  return factor < 1 + kInside * (kAround - 1);
}

}  // namespace lf
