// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <set>
#include <span>
#include <utility>
#include <vector>

#include "rig/delaunay.h"
#include "rig/plane_coordinates.h"

// Exact checks of triangle sets whose corners are integer points.
namespace lf::test {

inline int64_t twice_area(std::span<const IntPoint> points, const Triangle& t) {
  return orientation(points[t[0]], points[t[1]], points[t[2]]);
}

inline int64_t twice_area(std::span<const IntPoint> points, std::span<const Triangle> triangles) {
  int64_t sum = 0;
  for (const Triangle& t : triangles) sum += twice_area(points, t);
  return sum;
}

// Twice the area of the convex hull (Andrew's monotone chain).
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

// Whether the insides of two counter-clockwise triangles meet: they don't if a side of one separates them.
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

// All counter-clockwise, no directed edge twice, and no two overlap.
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
