// SPDX-License-Identifier: LGPL-2.1-or-later
#include "focus/plane_map.h"

#include <optional>

namespace lf {

double plane_inverse(const View& view, const Plane& from, const Vec3& ray) {
  const Vec3 d = view.pose.rotation() * ray;
  const Plane& plane = view.focus.plane;
  const double t = -plane.signed_distance(view.pose.position) / glm::dot(plane.normal, d);
  const double distance = from.signed_distance(view.pose.position) + t * glm::dot(from.normal, d);
  return t > 0 && distance > 0 ? 1 / distance : 0;
}

FocalMap plane_map(const View& view, const Plane& from, double nearest, double farthest, int step) {
  FocalMap map =
      view.focus.map
          ? FocalMap{.step = view.focus.map->step, .columns = view.focus.map->columns, .rows = view.focus.map->rows}
          : FocalMap::for_view(view.width, view.height, step);
  map.from = from;
  map.nearest = nearest;
  map.farthest = farthest;
  const double middle = (map.step - 1) / 2.0, axis = plane_inverse(view, from, {0, 0, 1});
  map.levels.reserve(static_cast<size_t>(map.columns) * static_cast<size_t>(map.rows));
  for (int j = 0; j < map.rows; j++)
    for (int i = 0; i < map.columns; i++) {
      const std::optional<Vec2> ray = view.lens.unproject({map.step * i + middle, map.step * j + middle});
      map.levels.push_back(map.level_of(ray ? plane_inverse(view, from, {*ray, 1}) : axis));
    }
  return map;
}

}  // namespace lf
