// SPDX-License-Identifier: LGPL-2.1-or-later
#include "rig/mesh.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <string>
#include <utility>

#include "base/error.h"
#include "rig/delaunay.h"
#include "rig/hole_filling.h"
#include "rig/plane_coordinates.h"

namespace lf {

namespace {

std::vector<Triangle> grid_triangles(const Rig& rig) {
  const auto& [type, rows, columns, listed] = rig.topology;
  if (rows < 1 || columns < 1 || static_cast<uint64_t>(rows) * columns != rig.cameras.size()) {
    throw Error("topology: a grid of " + std::to_string(rows) + " rows x " + std::to_string(columns) +
                " columns does not fit " + std::to_string(rig.cameras.size()) + " cameras");
  }
  std::vector<Triangle> faces;
  const CameraIndex width = columns;
  for (int row = 0; row + 1 < rows; ++row) {
    for (int column = 0; column + 1 < columns; ++column) {
      const CameraIndex a = row * width + column;
      faces.push_back({a, a + 1, a + width});
      faces.push_back({a + 1, a + width + 1, a + width});
    }
  }
  return faces;
}

std::vector<Triangle> listed_triangles(const Rig& rig) {
  const std::vector<Triangle>& faces = rig.topology.triangles;
  for (size_t i = 0; i < faces.size(); ++i) {
    for (int k = 0; k < 3; ++k) {
      if (faces[i][k] < rig.cameras.size()) continue;
      throw Error("topology.triangles[" + std::to_string(i) + "][" + std::to_string(k) + "]: there is no camera " +
                  std::to_string(faces[i][k]));
    }
  }
  return faces;
}

std::vector<Triangle> delaunay_triangles(const CameraCentres& centres, const PlaneAxes& plane,
                                         const std::vector<CameraIndex>& in_service) {
  std::vector<IntPoint> points;
  for (const CameraIndex i : in_service) points.push_back(quantise(centres.at[i], plane, centres.quantum));
  std::vector<Triangle> faces = delaunay(points);
  // in_service ascends, so lowest-first and sorted stay so.
  for (Triangle& t : faces) t = {in_service[t[0]], in_service[t[1]], in_service[t[2]]};
  return faces;
}

PlaneAxes plane_of_cameras(const Rig& rig, const CameraCentres& centres) {
  Vec3 right(0), forward(0);
  for (const Camera& camera : rig.cameras) {
    right += camera.pose.right();
    forward += camera.pose.forward();
  }
  return best_fit_plane(centres.at, right, forward);
}

bool any_has_area(const std::vector<Triangle>& faces, const CameraCentres& centres) {
  return std::any_of(faces.begin(), faces.end(), [&](const Triangle& t) {
    return !on_one_line(centres.at[t[0]], centres.at[t[1]], centres.at[t[2]], centres.quantum);
  });
}

}  // namespace

Mesh build_mesh(const Rig& rig, const CameraSet& out_of_service) {
  std::vector<char> is_out(rig.cameras.size(), 0);
  for (const CameraIndex i : out_of_service) {
    if (i >= rig.cameras.size()) throw Error("out of service: there is no camera " + std::to_string(i));
    is_out[i] = 1;
  }
  std::vector<CameraIndex> in_service;
  std::vector<Vec3> positions;
  for (CameraIndex i = 0; i < rig.cameras.size(); ++i) {
    if (!is_out[i]) in_service.push_back(i);
    positions.push_back(rig.cameras[i].pose.position);
  }
  // Of all cameras: coordinates do not change when a camera fails.
  const CameraCentres centres = normalised_centres(positions);
  const PlaneAxes plane = plane_of_cameras(rig, centres);

  std::vector<Triangle> triangles;
  if (rig.topology.type == Topology::Type::kDelaunay) {
    triangles = delaunay_triangles(centres, plane, in_service);
  } else {
    triangles = rig.topology.type == Topology::Type::kGrid ? grid_triangles(rig) : listed_triangles(rig);
    for (CameraIndex i = 0; i < rig.cameras.size(); ++i) {
      if (is_out[i]) remove_camera(triangles, i, centres, plane);
    }
  }
  if (!any_has_area(triangles, centres)) return {make_strips(rig, in_service, centres)};
  Mesh mesh;
  mesh.faces.reserve(triangles.size());
  for (const Triangle& t : triangles) mesh.faces.push_back({t, {}});
  return mesh;
}

CameraSet corner_cameras(const Rig& rig) {
  std::vector<Vec3> positions;
  for (const Camera& camera : rig.cameras) positions.push_back(camera.pose.position);
  const CameraCentres centres = normalised_centres(positions);
  const PlaneAxes plane = plane_of_cameras(rig, centres);
  using Place = std::pair<IntPoint, CameraIndex>;
  std::vector<Place> places;
  for (CameraIndex i = 0; i < positions.size(); ++i)
    places.emplace_back(quantise(centres.at[i], plane, centres.quantum), i);
  std::ranges::sort(places);
  const auto same_place = [](const Place& a, const Place& b) { return a.first == b.first; };
  places.erase(std::unique(places.begin(), places.end(), same_place), places.end());
  // Its lower and its upper half (Andrew 1979).
  CameraSet corners;
  for (int half = 0; half < 2; ++half) {
    std::vector<Place> chain;
    for (const Place& place : places) {
      while (chain.size() >= 2 && orientation(chain[chain.size() - 2].first, chain.back().first, place.first) <= 0)
        chain.pop_back();
      chain.push_back(place);
    }
    for (const Place& place : chain) corners.push_back(place.second);
    std::ranges::reverse(places);
  }
  std::ranges::sort(corners);
  corners.erase(std::unique(corners.begin(), corners.end()), corners.end());
  return corners;
}

CameraSet out_of_mesh(const CameraSet& lost, const CameraSet& corners, size_t num_cameras) {
  if (lost.size() + 3 > num_cameras) return lost;
  CameraSet out;
  std::ranges::set_difference(lost, corners, std::back_inserter(out));
  return out;
}

const Mesh& MeshCache::get(const Rig& rig, const CameraSet& out_of_service) {
  if (!mesh_ || out_of_service != out_of_service_) {
    mesh_ = build_mesh(rig, out_of_service);
    out_of_service_ = out_of_service;
  }
  return *mesh_;
}

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
