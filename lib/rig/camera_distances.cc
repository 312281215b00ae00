// SPDX-License-Identifier: LGPL-2.1-or-later
#include "rig/camera_distances.h"

#include <algorithm>
#include <limits>
#include <utility>
#include <vector>

namespace lf {
namespace {

std::pair<Vec3, Vec3> bounding_box(const Rig& rig) {
  Vec3 least(std::numeric_limits<double>::infinity()), most(-std::numeric_limits<double>::infinity());
  for (const Camera& camera : rig.cameras) {
    least = glm::min(least, camera.pose.position);
    most = glm::max(most, camera.pose.position);
  }
  return {least, most};
}

}  // namespace

int widest_axis(const Rig& rig) {
  const auto [least, most] = bounding_box(rig);
  const Vec3 size = most - least;
  return size.x >= size.y && size.x >= size.z ? 0 : size.y >= size.z ? 1 : 2;
}

// Two cameras are no farther apart than their distances from the centre together: pairs are tried from the outside in,
// until these sums are no larger than what was found.
double largest_distance(const Rig& rig) {
  if (rig.cameras.size() < 2) return 0;
  const auto [least, most] = bounding_box(rig);
  const Vec3 centre = 0.5 * (least + most);
  std::vector<std::pair<double, Vec3>> places;
  for (const Camera& camera : rig.cameras)
    places.emplace_back(glm::distance(camera.pose.position, centre), camera.pose.position);
  std::ranges::sort(places, [](const auto& a, const auto& b) { return a.first > b.first; });
  // A good beginning: from the outermost camera to the farthest from it, and so on.
  double largest = 0;
  Vec3 from = places[0].second;
  for (int i = 0; i < 3; i++) {
    Vec3 farthest = from;
    for (const auto& [radius, place] : places)
      if (glm::distance(from, place) > glm::distance(from, farthest)) farthest = place;
    largest = std::max(largest, glm::distance(from, farthest));
    from = farthest;
  }
  constexpr double kExact = 1 + 1e-9;
  for (size_t i = 0; i < places.size() && 2 * places[i].first > largest * kExact; i++)
    for (size_t j = i + 1; j < places.size() && places[i].first + places[j].first > largest * kExact; j++)
      largest = std::max(largest, glm::distance(places[i].second, places[j].second));
  return largest;
}

// From each camera both ways along the widest axis, as long as that distance alone is shorter than the nearest found.
double mean_nearest_distance(const Rig& rig) {
  if (rig.cameras.size() < 2) return 0;
  const int axis = widest_axis(rig);
  std::vector<Vec3> places;
  for (const Camera& camera : rig.cameras) places.push_back(camera.pose.position);
  std::ranges::sort(places, [axis](const Vec3& a, const Vec3& b) { return a[axis] < b[axis]; });
  double sum = 0;
  for (size_t i = 0; i < places.size(); i++) {
    double nearest = std::numeric_limits<double>::infinity();
    for (size_t j = i + 1; j < places.size() && places[j][axis] - places[i][axis] < nearest; j++)
      nearest = std::min(nearest, glm::distance(places[i], places[j]));
    for (size_t j = i; j-- > 0 && places[i][axis] - places[j][axis] < nearest;)
      nearest = std::min(nearest, glm::distance(places[i], places[j]));
    sum += nearest;
  }
  return sum / static_cast<double>(places.size());
}

}  // namespace lf
