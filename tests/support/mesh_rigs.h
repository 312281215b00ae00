// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <algorithm>
#include <iterator>
#include <random>
#include <vector>

#include "rig/delaunay.h"
#include "rig/mesh.h"
#include "rig/plane_coordinates.h"

// Rigs whose cameras look along +z, for tests of the mesh.
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

// In the plane z = 0, metres.
inline Rig rig_at(const std::vector<IntPoint>& points) {
  std::vector<Vec3> positions;
  for (const IntPoint p : points) positions.emplace_back(p.x, p.y, 0);
  return rig_at(positions);
}

// Places of a grid with this pitch; each off by up to `jitter` in x and y.
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

inline Rig as_grid(Rig rig, int rows, int columns) {
  rig.topology = {Topology::Type::kGrid, rows, columns, {}};
  return rig;
}

inline Rig as_triangles(Rig rig, const std::vector<Triangle>& triangles) {
  rig.topology = {Topology::Type::kTriangles, 0, 0, triangles};
  return rig;
}

// The cells of a grid, row by row.
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

// `count` different indices below `n`, ascending.
inline CameraSet random_set(std::mt19937& random, CameraIndex n, size_t count) {
  std::vector<CameraIndex> all(n);
  for (CameraIndex i = 0; i < n; ++i) all[i] = i;
  CameraSet set;
  std::sample(all.begin(), all.end(), std::back_inserter(set), count, random);
  return set;
}

}  // namespace lf::test
