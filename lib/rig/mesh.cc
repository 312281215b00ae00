// SPDX-License-Identifier: LGPL-2.1-or-later
#include "rig/mesh.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <iterator>
#include <map>
#include <set>
#include <string>
#include <utility>

#include <glm/matrix.hpp>

#include "base/text.h"

namespace lf {
namespace {

std::vector<Triangle> grid_triangles(const Rig& rig) {
  const auto& [type, rows, columns, listed] = rig.topology;
  if (rows < 1 || columns < 1 || static_cast<uint64_t>(rows) * columns != rig.cameras.size()) {
    throw Error("topology: a grid of " + std::to_string(rows) + " rows x " + std::to_string(columns) +
                " columns does not match the rig, which has " + std::to_string(rig.cameras.size()) + " cameras");
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
      throw Error("topology.triangles[" + std::to_string(i) + "][" + std::to_string(k) +
                  "]: there is no camera with the index " + std::to_string(faces[i][k]));
    }
  }
  return faces;
}

std::vector<Triangle> delaunay_triangles(const CameraCentres& centres, const PlaneAxes& plane,
                                         const std::vector<CameraIndex>& in_service) {
  std::vector<IntPoint> points;
  for (const CameraIndex i : in_service) points.push_back(quantise(centres.at[i], plane, centres.quantum));
  std::vector<Triangle> faces = delaunay(points);
  // in_service is ascending, so lowest-first and sorted order are preserved.
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
    return !are_collinear(centres.at[t[0]], centres.at[t[1]], centres.at[t[2]], centres.quantum);
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
  // Axes come from all cameras, so that coordinates do not change when a camera fails.
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

CameraSet hull_cameras(const Rig& rig) {
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
  // Lower and upper half of the hull (Andrew 1979).
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

CameraSet mesh_exclusions(const CameraSet& lost, const CameraSet& corners, size_t num_cameras) {
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
  // The cameras look in all directions: any perpendicular works if it is the same on every machine.
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

namespace {

constexpr double kMinCosine = 0.25;     // minimum cosine between an optical axis and a face normal: 75 degrees
constexpr double kThinTriangle = 0.02;  // height over the longest side; same as the slivers of check_rig()
constexpr double kFlatRow = 0.1;        // height of a row over the distance between neighbours
constexpr double kSuits = 0.9;          // minimum share of well-placed triangles and cameras for keeping a mesh
constexpr double kMaxFolded = 0.002;    // height over the longest side below which a grid triangle counts as flat

// Returns the cross product of two sides over the square of the longest side. Its length is the height over the longest
// side.
Vec3 relative_normal(const Vec3& a, const Vec3& b, const Vec3& c) {
  const double longest = std::max({glm::length(b - a), glm::length(c - b), glm::length(a - c)});
  return longest > 0 ? glm::cross((b - a) / longest, (c - a) / longest) : Vec3(0);
}

// Positions within +-1, and unit viewing directions.
struct CameraAxes {
  std::vector<Vec3> at, forward;
  CameraCentres centres;
};

std::optional<CameraAxes> camera_axes(const Rig& rig) {
  std::vector<Vec3> positions;
  CameraAxes axes;
  for (const Camera& camera : rig.cameras) {
    positions.push_back(camera.pose.position);
    axes.forward.push_back(camera.pose.forward());
  }
  axes.centres = normalised_centres(positions);
  axes.at = axes.centres.at;
  const auto finite = [](const Vec3& v) { return is_finite(v); };
  if (!std::ranges::all_of(axes.at, finite) || !std::ranges::all_of(axes.forward, finite)) return std::nullopt;
  return axes;
}

// True if the viewing directions of all corners cross the triangle to the same side. `side` 0 allows either side;
// otherwise it selects the side relative to `outwards`.
bool cameras_face(const CameraAxes& axes, const Triangle& t, int side, const Vec3& outwards) {
  Vec3 normal = relative_normal(axes.at[t[0]], axes.at[t[1]], axes.at[t[2]]);
  const double height = glm::length(normal);
  if (!(height >= kThinTriangle)) return false;
  normal /= height;
  if (side != 0 && glm::dot(normal, outwards) < 0) normal = -normal;
  double least = 1, most = -1;
  for (const CameraIndex i : t) {
    const double cosine = glm::dot(normal, axes.forward[i]);
    least = std::min(least, cosine);
    most = std::max(most, cosine);
  }
  return (side >= 0 && least >= kMinCosine) || (side <= 0 && most <= -kMinCosine);
}

struct Fit {
  double triangles = 1;  // share, by area, of triangles with cameras that look through them, without slivers
  double cameras = 0;    // share of cameras at, or close to, a corner of such a triangle
  double both() const { return triangles * cameras; }
};

// Marks cameras that are close to a marked one, relative to the length of edges. A triangulation uses only one of them
// if they have the same position on its plane.
void mark_close_cameras(const CameraAxes& axes, double edge, std::vector<bool>& marks) {
  constexpr double kClose = 0.1;
  using Cell = std::array<int64_t, 3>;
  const auto cell_of = [&](size_t i) {
    const Vec3 at = axes.at[i] / (kClose * edge);
    return Cell{std::llround(at.x), std::llround(at.y), std::llround(at.z)};
  };
  std::set<Cell> marked;
  for (size_t i = 0; i < marks.size(); i++)
    if (marks[i]) marked.insert(cell_of(i));
  for (size_t i = 0; i < marks.size(); i++) {
    const Cell own = cell_of(i);
    for (int n = 0; n < 27 && !marks[i]; n++)
      marks[i] = marked.contains({own[0] + n % 3 - 1, own[1] + n / 3 % 3 - 1, own[2] + n / 9 - 1});
  }
}

Fit fit_of(const CameraAxes& axes, const std::vector<Triangle>& triangles) {
  std::vector<bool> is_facing(axes.at.size());
  double good = 0, whole = 0;
  std::vector<double> edges;
  for (const Triangle& t : triangles) {
    // Cameras that are close together, at different depths, form small steep triangles that hardly any view looks
    // through.
    const double area = glm::length(glm::cross(axes.at[t[1]] - axes.at[t[0]], axes.at[t[2]] - axes.at[t[0]])) / 2;
    if (glm::length(relative_normal(axes.at[t[0]], axes.at[t[1]], axes.at[t[2]])) >= kThinTriangle) whole += area;
    if (!cameras_face(axes, t, 0, {})) continue;
    good += area;
    for (const CameraIndex i : t) is_facing[i] = true;
    edges.push_back(glm::length(axes.at[t[1]] - axes.at[t[0]]));
  }
  if (!edges.empty()) mark_close_cameras(axes, median(std::move(edges)), is_facing);
  Fit fit;
  if (whole > 0) fit.triangles = good / whole;
  fit.cameras = static_cast<double>(std::ranges::count(is_facing, true)) / static_cast<double>(is_facing.size());
  return fit;
}

std::vector<Triangle> triangles_of(const Mesh& mesh) {
  std::vector<Triangle> triangles;
  for (const MeshFace& face : mesh.faces)
    if (face.corners() == 3) triangles.push_back(face.camera);
  return triangles;
}

// True for cameras in a row, or on an arc of less than half a circle, that look across the row.
bool is_row(const CameraAxes& axes) {
  const Vec3 line = principal_axes(axes.at).x;
  Vec3 forward(0);
  for (const Vec3& f : axes.forward) forward += f;
  Vec3 up = glm::cross(line, forward);
  if (!(glm::length(up) > 1e-6 * static_cast<double>(axes.at.size()))) return false;
  up = glm::normalize(up);
  const Vec3 ahead = glm::normalize(glm::cross(up, line));
  double left = INFINITY, right = -INFINITY, low = INFINITY, high = -INFINITY;
  for (size_t i = 0; i < axes.at.size(); i++) {
    if (!(glm::dot(axes.forward[i], ahead) > 0)) return false;
    const double along = glm::dot(axes.at[i], line), height = glm::dot(axes.at[i], up);
    left = std::min(left, along), right = std::max(right, along);
    low = std::min(low, height), high = std::max(high, height);
  }
  return high - low < kFlatRow * (right - left) / static_cast<double>(axes.at.size() - 1);
}

// Returns the least-squares nearest point to all optical axes, or nullopt if the axes are nearly parallel.
std::optional<Vec3> centre_of_axes(const CameraAxes& axes) {
  Mat3 sum(0.0);
  Vec3 right_side(0);
  for (size_t i = 0; i < axes.at.size(); i++) {
    const Mat3 across = Mat3(1) - glm::outerProduct(axes.forward[i], axes.forward[i]);
    sum += across;
    right_side += across * axes.at[i];
  }
  sum /= static_cast<double>(axes.at.size());
  right_side /= static_cast<double>(axes.at.size());
  if (!(glm::determinant(sum) > 1e-6)) return std::nullopt;
  return glm::inverse(sum) * right_side;
}

// Returns the direction with the largest gap on the sphere, from a few candidates: the pole of the stereographic
// projection.
Vec3 emptiest_direction(const std::vector<Vec3>& directions) {
  const PlaneAxes axes = principal_axes(directions);
  Vec3 mean(0);
  for (const Vec3& u : directions) mean += u;
  std::vector<Vec3> poles = {axes.normal, -axes.normal, axes.y, -axes.y, axes.x, -axes.x};
  if (glm::length(mean) > 1e-6 * static_cast<double>(directions.size()))
    poles.insert(poles.begin(), -glm::normalize(mean));
  Vec3 best = poles[0];
  double least = INFINITY;
  for (const Vec3& pole : poles) {
    double nearest = -1;
    for (const Vec3& u : directions) nearest = std::max(nearest, glm::dot(u, pole));
    if (nearest < least - 1e-9) {
      least = nearest;
      best = pole;
    }
  }
  return best;
}

void close_hull(std::vector<Triangle>& triangles) {
  std::map<std::pair<CameraIndex, CameraIndex>, bool> edges;  // true if there is a triangle on the other side
  for (const Triangle& t : triangles)
    for (int k = 0; k < 3; k++) edges[{t[k], t[(k + 1) % 3]}] = true;
  std::map<CameraIndex, CameraIndex> next;
  for (const auto& [edge, unused] : edges)
    if (!edges.contains({edge.second, edge.first})) next[edge.second] = edge.first;
  if (next.size() < 3) return;
  const CameraIndex first = next.begin()->first;
  CameraIndex at = next[first];
  for (size_t n = 0; n < next.size(); n++) {
    const auto after = next.find(at);
    if (after == next.end() || after->second == first) return;
    triangles.push_back(canonical_triangle({first, at, after->second}));
    at = after->second;
  }
}

std::vector<Triangle> triangles_around(const CameraAxes& axes, bool& inwards) {
  const std::optional<Vec3> centre = centre_of_axes(axes);
  if (!centre) return {};
  std::vector<Vec3> directions;
  std::vector<CameraIndex> cameras;
  double sum = 0;
  for (size_t i = 0; i < axes.at.size(); i++) {
    const Vec3 from_centre = axes.at[i] - *centre;
    const double distance = glm::length(from_centre);
    if (!(distance > 1e-6)) continue;
    directions.push_back(from_centre / distance);
    cameras.push_back(static_cast<CameraIndex>(i));
    sum += glm::dot(directions.back(), axes.forward[i]);
  }
  if (cameras.size() < 3) return {};
  inwards = sum < 0;
  const Vec3 pole = emptiest_direction(directions);
  const PlaneAxes plane = plane_with_normal(pole, {});
  std::vector<Vec3> flat;
  for (const Vec3& u : directions) {
    const double depth = std::max(1 - glm::dot(u, pole), 1e-6);
    flat.push_back({glm::dot(u, plane.x) / depth, glm::dot(u, plane.y) / depth, 0});
  }
  const CameraCentres centres = normalised_centres(flat);
  std::vector<IntPoint> points;
  for (const Vec3& at : centres.at) points.push_back(quantise(at, {}, centres.quantum));
  std::vector<Triangle> triangles = delaunay(points);
  close_hull(triangles);
  std::vector<Triangle> kept;
  for (const Triangle& t : triangles) {
    const Triangle named = canonical_triangle({cameras[t[0]], cameras[t[1]], cameras[t[2]]});
    const Vec3 outwards = directions[t[0]] + directions[t[1]] + directions[t[2]];
    if (cameras_face(axes, named, inwards ? -1 : 1, outwards)) kept.push_back(named);
  }
  std::ranges::sort(kept);
  kept.erase(std::unique(kept.begin(), kept.end()), kept.end());
  return kept;
}

}  // namespace

double share_facing_cameras(const Rig& rig, const Mesh& mesh) {
  const std::vector<Triangle> triangles = triangles_of(mesh);
  const std::optional<CameraAxes> axes = camera_axes(rig);
  return triangles.empty() || !axes ? 1 : fit_of(*axes, triangles).triangles;
}

std::vector<std::string> fit_topology(Rig& rig) {
  if (rig.topology.type != Topology::Type::kDelaunay || rig.cameras.size() < 3) return {};
  const std::optional<CameraAxes> axes = camera_axes(rig);
  if (!axes) return {};
  const std::vector<Triangle> flat = triangles_of(build_mesh(rig));
  if (flat.empty()) return {};
  if (is_row(*axes)) {
    rig.topology = {Topology::Type::kTriangles, 0, 0, {}};
    return {"the cameras form a row, so the topology has no triangles and views blend along the row"};
  }
  const double share = fit_of(*axes, flat).both();
  if (share >= kSuits) return {};
  bool inwards = false;
  std::vector<Triangle> around = triangles_around(*axes, inwards);
  if (const double share_around = fit_of(*axes, around).both(); share_around > share) {
    rig.topology = {Topology::Type::kTriangles, 0, 0, {}};
    rig.topology.triangles = std::move(around);
    return {std::string("the cameras surround a point and look ") + (inwards ? "at it" : "away from it") +
            ": the mesh surrounds the point (" + std::to_string(rig.topology.triangles.size()) + " triangles)"};
  }
  if (share >= 0.5) return {};
  return {
      "no mesh suits the viewing directions: most cameras look along its faces, so views between cameras stay "
      "black. An inward-looking ring needs two rows. For a ring with one row, use lf-rig subset to keep an arc of "
      "less than half a circle"};
}

std::optional<GridFault> find_grid_fault(const Rig& rig) {
  const Topology& grid = rig.topology;
  if (grid.type != Topology::Type::kGrid || grid.rows < 2 || grid.columns < 2) return std::nullopt;
  const std::optional<CameraAxes> axes = camera_axes(rig);
  if (!axes) return std::nullopt;
  const std::vector<Triangle> triangles = triangles_of(build_mesh(rig));
  // For each triangle, the side that its cameras look to: 1 or -1, or 0 for a flat triangle.
  std::vector<int> sides;
  int balance = 0;
  for (const Triangle& t : triangles) {
    const Vec3 normal = relative_normal(axes->at[t[0]], axes->at[t[1]], axes->at[t[2]]);
    const double cosine = glm::dot(normal, axes->forward[t[0]] + axes->forward[t[1]] + axes->forward[t[2]]);
    sides.push_back(glm::length(normal) < kMaxFolded ? 0 : cosine > 0 ? 1 : -1);
    balance += sides.back();
  }
  const int usual = balance < 0 ? -1 : 1;
  GridFault fault;
  fault.triangles = triangles.size();
  for (size_t i = 0; i < triangles.size(); i++) {
    if (sides[i] == usual) continue;
    if (fault.folded++ > 0) continue;
    const auto name = [&](CameraIndex camera) {
      const std::string& text = rig.cameras[camera].name;
      return text.empty() ? "camera " + std::to_string(rig.cameras[camera].id) : text;
    };
    const Triangle& t = triangles[i];
    fault.text = name(t[0]) + ", " + name(t[1]) + ", " + name(t[2]) +
                 (sides[i] == 0 ? " are collinear" : " are in reverse order");
  }
  if (fault.folded == 0 && triangles.size() > 0) return std::nullopt;
  if (triangles.empty()) {
    fault.folded = fault.triangles = 2 * static_cast<size_t>(grid.rows - 1) * static_cast<size_t>(grid.columns - 1);
    fault.text = "all cameras are collinear";
  }
  fault.text = "the cameras form no grid of " + std::to_string(grid.rows) + "x" + std::to_string(grid.columns) +
               " in this order: " + fault.text + " (" + std::to_string(fault.folded) + " of " +
               std::to_string(fault.triangles) + " triangles)";
  return fault;
}

}  // namespace lf
