// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <algorithm>
#include <iterator>
#include <memory>
#include <numeric>
#include <random>
#include <set>
#include <span>
#include <utility>
#include <vector>

#include <gtest/gtest.h>

#include "rig/mesh.h"
#include "rig/rig.h"
#include "rig/triangulation.h"
#include "view/view.h"

namespace lf::test {

inline Rig rig_at(const std::vector<Vec3>& positions) {
  Rig rig;
  for (const Vec3& position : positions) {
    Camera camera;
    camera.id = static_cast<uint32_t>(rig.cameras.size());
    camera.pose.position = position;
    rig.cameras.push_back(camera);
  }
  return rig;
}

inline Rig camera_grid(int rows, int columns, double pitch, int width, int height, double f, uint32_t first_id = 0) {
  Rig rig;
  for (int i = 0; i < rows * columns; i++) {
    Camera camera;
    camera.id = first_id + static_cast<uint32_t>(i);
    camera.width = width;
    camera.height = height;
    camera.lens = Lens::pinhole(f, (width - 1) / 2.0, (height - 1) / 2.0);
    camera.pose.position = {pitch * (i % columns), pitch * (i / columns), 0};
    rig.cameras.push_back(camera);
  }
  rig.topology = {Topology::Type::kGrid, rows, columns, {}};
  return rig;
}

// In the plane z = 0, metres.
inline Rig rig_at(const std::vector<IntPoint>& points) {
  std::vector<Vec3> positions;
  for (const IntPoint p : points) positions.emplace_back(p.x, p.y, 0);
  return rig_at(positions);
}

// Returns grid positions, each moved by up to `jitter` in x and y.
inline std::vector<IntPoint> grid_points(int rows, int columns, int pitch = 1000, int jitter = 0, unsigned seed = 0) {
  std::mt19937 random(seed);
  std::uniform_int_distribution<int> off(-jitter, jitter);
  std::vector<IntPoint> points;
  for (int i = 0; i < rows * columns; ++i) {
    const int dx = off(random), dy = off(random);
    points.push_back({i % columns * pitch + dx, i / columns * pitch + dy});
  }
  return points;
}

// Returns the indices of all cameras.
inline CameraSet all_cameras(const Rig& rig) {
  CameraSet cameras(rig.cameras.size());
  std::iota(cameras.begin(), cameras.end(), 0);
  return cameras;
}

inline Rig as_grid(Rig rig, int rows, int columns) {
  rig.topology = {Topology::Type::kGrid, rows, columns, {}};
  return rig;
}

inline Rig as_triangles(Rig rig, const std::vector<Triangle>& triangles) {
  rig.topology = {Topology::Type::kTriangles, 0, 0, triangles};
  return rig;
}

inline std::vector<Triangle> grid_faces(CameraIndex rows, CameraIndex columns) {
  std::vector<Triangle> faces;
  for (CameraIndex row = 0; row + 1 < rows; ++row) {
    for (CameraIndex column = 0; column + 1 < columns; ++column) {
      const CameraIndex a = row * columns + column;
      faces.push_back({a, a + 1, a + columns});
      faces.push_back({a + 1, a + columns + 1, a + columns});
    }
  }
  return faces;
}

inline std::vector<Triangle> corners(const Mesh& mesh) {
  std::vector<Triangle> result;
  for (const MeshFace& face : mesh.faces) result.push_back(face.camera);
  return result;
}

inline CameraSet random_set(std::mt19937& random, CameraIndex n, size_t count) {
  CameraSet all(n), set;
  std::iota(all.begin(), all.end(), 0);
  std::sample(all.begin(), all.end(), std::back_inserter(set), count, random);
  return set;
}

// Returns a view that looks along +z, with a vertical field of view in degrees. `focus`: metres.
inline View view_from(const Vec3& position, int width, int height, double fov_y, double focus) {
  const Pose pose{.position = position};
  return {width, height, Lens::from_fov_y(fov_y, width, height), pose, {focal_plane_at(pose, focus)}};
}

// Returns a focal surface for a view of `width` x `height` pixels, with all nodes at `level`. `farthest` and `nearest`:
// inverse distances from the plane `from`, 1/m.
inline std::shared_ptr<FocalMap> level_surface(int width, int height, double farthest, double nearest, uint8_t level,
                                               const Plane& from = {{0, 0, 1}, 0}) {
  auto map = std::make_shared<FocalMap>(FocalMap::for_view(width, height));
  map->from = from;
  map->farthest = farthest;
  map->nearest = nearest;
  map->levels.assign(static_cast<size_t>(map->columns) * map->rows, level);
  return map;
}

// Exact checks of triangles with integer corners.

inline int64_t twice_area(std::span<const IntPoint> points, const Triangle& t) {
  return orientation(points[t[0]], points[t[1]], points[t[2]]);
}

inline int64_t twice_area(std::span<const IntPoint> points, std::span<const Triangle> triangles) {
  int64_t sum = 0;
  for (const Triangle& t : triangles) sum += twice_area(points, t);
  return sum;
}

// Returns twice the area of the convex hull (Andrew's monotone chain).
inline int64_t twice_hull_area(std::vector<IntPoint> points) {
  std::sort(points.begin(), points.end());
  std::vector<IntPoint> hull;
  for (int half = 0; half < 2; ++half) {
    const size_t start = hull.size();
    for (const IntPoint p : points) {
      while (hull.size() > start + 1 && orientation(hull[hull.size() - 2], hull.back(), p) <= 0) hull.pop_back();
      hull.push_back(p);
    }
    hull.pop_back();
    std::reverse(points.begin(), points.end());
  }
  int64_t area = 0;
  for (size_t i = 0; i + 1 < hull.size(); ++i) area += orientation(hull[0], hull[i], hull[i + 1]);
  return area;
}

// True if the interiors of two counter-clockwise triangles intersect, that is if no side separates the triangles.
inline bool overlap(std::span<const IntPoint> points, const Triangle& a, const Triangle& b) {
  for (const auto& [one, two] : {std::pair{a, b}, std::pair{b, a}}) {
    for (int k = 0; k < 3; ++k) {
      const auto outside = [&](CameraIndex i) {
        return orientation(points[one[k]], points[one[(k + 1) % 3]], points[i]) <= 0;
      };
      if (std::all_of(two.begin(), two.end(), outside)) return false;
    }
  }
  return true;
}

// Expects counter-clockwise triangles without overlaps and without duplicate directed edges.
inline void expect_planar(std::span<const IntPoint> points, std::span<const Triangle> triangles) {
  std::set<std::pair<CameraIndex, CameraIndex>> edges;
  for (size_t i = 0; i < triangles.size(); ++i) {
    const Triangle& t = triangles[i];
    ASSERT_GT(twice_area(points, t), 0) << t[0] << " " << t[1] << " " << t[2];
    for (int k = 0; k < 3; ++k) ASSERT_TRUE(edges.insert({t[k], t[(k + 1) % 3]}).second);
    for (size_t j = 0; j < i; ++j) ASSERT_FALSE(overlap(points, t, triangles[j])) << "faces " << j << " and " << i;
  }
}

}  // namespace lf::test

namespace lf {

inline Rig mixed_rig() {
  using enum LensModel;
  const Lens lenses[] = {Lens(kSimplePinhole, {400, 159.5, 119.5}), Lens(kPinhole, {400, 410, 160, 118}),
                         Lens(kSimpleRadial, {400, 159.5, 119.5, -0.1}),
                         Lens(kRadial, {386.73880838315351, 159.5, 119.5, -0.15, 0.03}),
                         Lens(kOpenCv, {400, 410, 160, 118, -0.15, 0.03, 1e-3, -2e-3})};
  Rig rig;
  for (const Lens& lens : lenses) {
    Camera camera;
    const double i = static_cast<double>(rig.cameras.size());
    camera.id = 20 - static_cast<uint32_t>(rig.cameras.size());
    camera.name = "cam_" + std::to_string(rig.cameras.size());
    camera.image = camera.name + ".png";
    camera.width = 320;
    camera.height = 240;
    camera.lens = lens;
    camera.pose = {{57.1 + i / 3, -23.4 * i, 1 / (i + 3)}, glm::normalize(Quat(0.3 - i / 4, 0.2, -0.5, 0.1 * i))};
    rig.cameras.push_back(camera);
  }
  return rig;
}

}  // namespace lf
