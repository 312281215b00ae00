// SPDX-License-Identifier: LGPL-2.1-or-later
#include "rig/strips.h"

#include <algorithm>
#include <cmath>
#include <utility>

namespace lf {
namespace {

// Unit vector perpendicular to the unit vector `line`.
Vec3 strip_extent(const Rig& rig, std::span<const CameraIndex> in_service, const Vec3& line) {
  Vec3 forward(0), down(0);
  for (const CameraIndex i : in_service) {
    forward += rig.cameras[i].pose.forward();
    down += rig.cameras[i].pose.down();
  }
  const double enough = 1e-6 * static_cast<double>(in_service.size());
  const Vec3 across = glm::cross(forward, line);
  if (glm::length(across) > enough) return glm::normalize(across);
  const Vec3 downwards = down - line * glm::dot(line, down);
  if (glm::length(downwards) > enough) return glm::normalize(downwards);
  // Cameras that look every way: any perpendicular will do, if it is the same everywhere.
  const Vec3 size = glm::abs(line);
  const Vec3 axis = size.x <= size.y && size.x <= size.z ? Vec3(1, 0, 0)
                    : size.y <= size.z                   ? Vec3(0, 1, 0)
                                                         : Vec3(0, 0, 1);
  return glm::normalize(glm::cross(axis, line));
}

}  // namespace

std::vector<MeshFace> make_strips(const Rig& rig, std::span<const CameraIndex> in_service,
                                  const CameraCentres& centres) {
  if (in_service.empty()) return {};
  std::vector<Vec3> at;
  for (const CameraIndex i : in_service) at.push_back(centres.at[i]);
  Vec3 line = principal_axes(at).x;
  std::vector<std::pair<int64_t, CameraIndex>> places;
  for (size_t k = 0; k < at.size(); ++k) {
    places.emplace_back(std::llround(glm::dot(at[k] - at[0], line) / centres.quantum), in_service[k]);
  }
  std::sort(places.begin(), places.end());
  const auto same_place = [](const auto& a, const auto& b) { return a.first == b.first; };
  places.erase(std::unique(places.begin(), places.end(), same_place), places.end());
  if (places.size() == 1) return {MeshFace{{places[0].second, MeshFace::kNone, MeshFace::kNone}, {}}};
  if (places.back().second < places.front().second) {
    std::reverse(places.begin(), places.end());
    line = -line;
  }
  const Vec3 extent = strip_extent(rig, in_service, line);
  std::vector<MeshFace> faces;
  for (size_t k = 0; k + 1 < places.size(); ++k) {
    faces.push_back({{places[k].second, places[k + 1].second, MeshFace::kNone}, extent});
  }
  return faces;
}

}  // namespace lf
