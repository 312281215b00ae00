// SPDX-License-Identifier: LGPL-2.1-or-later
#include "rig/delaunay.h"

#include <algorithm>
#include <array>
#include <cstdint>
#include <utility>

namespace lf {

namespace {

// First any triangulation, by adding the points from left to right to their convex hull, then Lawson's flips (1977).
// Vertices are places in the sorted order.
class Triangulation {
 public:
  explicit Triangulation(std::span<const IntPoint> points) : points_(points) {
    for (uint32_t i = 0; i < points.size(); ++i) order_.push_back(i);
    std::sort(order_.begin(), order_.end(),
              [&](uint32_t a, uint32_t b) { return points[a] != points[b] ? points[a] < points[b] : a < b; });
    const auto same_place = [&](uint32_t a, uint32_t b) { return points[a] == points[b]; };
    order_.erase(std::unique(order_.begin(), order_.end(), same_place), order_.end());
    sweep();
    flip_all();
  }

  std::vector<Triangle> triangles() const {
    std::vector<Triangle> result;
    for (const Node& t : nodes_) {
      result.push_back(lowest_first({order_[t.vertex[0]], order_[t.vertex[1]], order_[t.vertex[2]]}));
    }
    std::sort(result.begin(), result.end());
    return result;
  }

 private:
  static constexpr int kNone = -1;
  struct Node {
    std::array<int, 3> vertex;                          // counter-clockwise
    std::array<int, 3> neighbour{kNone, kNone, kNone};  // across the edge opposite each vertex
  };

  IntPoint at(int vertex) const { return points_[order_[vertex]]; }

  void join(int t, int side, int u) {  // u has the same edge the other way round, or is kNone
    nodes_[t].neighbour[side] = u;
    if (u == kNone) return;
    const int from = nodes_[t].vertex[(side + 1) % 3];
    for (int k = 0; k < 3; ++k) {
      if (nodes_[u].vertex[(k + 2) % 3] == from) nodes_[u].neighbour[k] = t;
    }
  }

  // The hull is a ring of vertices, counter-clockwise; behind_[v] is the triangle at its edge v, next_[v].
  // Covers the hull's edge a, next_[a] by a triangle with apex p to its right.
  int cover(int a, int p) {
    const int t = static_cast<int>(nodes_.size()), b = next_[a];
    nodes_.push_back({{b, a, p}});
    join(t, 2, behind_[a]);
    return t;
  }

  void sweep() {
    const int n = static_cast<int>(order_.size());
    int first = 2;  // the first point off the line of those before it
    while (first < n && orientation(at(0), at(1), at(first)) == 0) ++first;
    if (first >= n) return;
    next_.assign(n, kNone);
    previous_.assign(n, kNone);
    behind_.assign(n, kNone);
    // A flat ring along the line, there and back; the side that the first point sees gets covered.
    const bool left = orientation(at(0), at(1), at(first)) > 0;
    int previous_triangle = kNone;
    for (int i = 0; i + 1 < first; ++i) {
      const int t = static_cast<int>(nodes_.size());
      if (left) {
        nodes_.push_back({{i, i + 1, first}});
        if (previous_triangle != kNone) join(t, 1, previous_triangle);
        link(i, i + 1, t);
      } else {
        nodes_.push_back({{i + 1, i, first}});
        if (previous_triangle != kNone) join(t, 0, previous_triangle);
        link(i + 1, i, t);
      }
      previous_triangle = t;
    }
    link(left ? first - 1 : 0, first, left ? previous_triangle : 0);
    link(first, left ? 0 : first - 1, left ? 0 : previous_triangle);
    for (int p = first + 1; p < n; ++p) add(p);
  }

  void link(int a, int b, int triangle) {
    next_[a] = b;
    previous_[b] = a;
    behind_[a] = triangle;
  }

  // p is to the right of all points so far, p - 1 the rightmost of these: the edges p sees adjoin p - 1.
  void add(int p) {
    int low = p - 1, high = p - 1;  // the seen chain from low to high along the ring
    int low_triangle = kNone, high_triangle = kNone;
    while (orientation(at(high), at(next_[high]), at(p)) < 0) {
      const int t = cover(high, p);
      if (high_triangle != kNone) join(t, 0, high_triangle);
      if (low_triangle == kNone) low_triangle = t;
      high_triangle = t;
      high = next_[high];
    }
    while (orientation(at(previous_[low]), at(low), at(p)) < 0) {
      low = previous_[low];
      const int t = cover(low, p);
      if (low_triangle != kNone) join(t, 1, low_triangle);
      if (high_triangle == kNone) high_triangle = t;
      low_triangle = t;
    }
    link(low, p, low_triangle);
    link(p, high, high_triangle);
  }

  // Among cocircular four the diagonal with the lowest index wins. Flips end: each lowers the lifted surface or, where
  // that stays, gives the lowest of its four vertices an edge and takes edges from higher ones only.
  bool should_flip(int t, int side) const {
    const int u = nodes_[t].neighbour[side];
    if (u == kNone) return false;
    const int a = nodes_[t].vertex[side], b = nodes_[t].vertex[(side + 1) % 3], c = nodes_[t].vertex[(side + 2) % 3];
    const int d = nodes_[u].vertex[side_towards(u, t)];
    const int inside = in_circle(at(a), at(b), at(c), at(d));
    if (inside != 0) return inside > 0;
    return std::min(order_[a], order_[d]) < std::min(order_[b], order_[c]);
  }

  int side_towards(int u, int t) const {
    const auto& n = nodes_[u].neighbour;
    return static_cast<int>(std::find(n.begin(), n.end(), t) - n.begin());
  }

  void flip(int t, int side) {  // (a, b, c), (d, c, b) to (a, b, d), (d, c, a)
    const int u = nodes_[t].neighbour[side], other = side_towards(u, t);
    const Node old_t = nodes_[t], old_u = nodes_[u];
    const int a = old_t.vertex[side], b = old_t.vertex[(side + 1) % 3], c = old_t.vertex[(side + 2) % 3];
    const int d = old_u.vertex[other];
    nodes_[t].vertex = {a, b, d};
    nodes_[u].vertex = {d, c, a};
    join(t, 0, old_u.neighbour[(other + 1) % 3]);
    join(t, 1, u);
    join(t, 2, old_t.neighbour[(side + 2) % 3]);
    join(u, 0, old_t.neighbour[(side + 1) % 3]);
    join(u, 2, old_u.neighbour[(other + 2) % 3]);
  }

  void flip_all() {
    std::vector<std::pair<int, int>> doubtful;
    for (int t = 0; t < static_cast<int>(nodes_.size()); ++t) {
      for (int side = 0; side < 3; ++side) doubtful.emplace_back(t, side);
    }
    while (!doubtful.empty()) {
      const auto [t, side] = doubtful.back();
      doubtful.pop_back();
      if (!should_flip(t, side)) continue;
      const int u = nodes_[t].neighbour[side];
      flip(t, side);
      // The four outer edges; an entry that named one of them by its old place is covered by these.
      doubtful.insert(doubtful.end(), {{t, 0}, {t, 2}, {u, 0}, {u, 2}});
    }
  }

  std::span<const IntPoint> points_;
  std::vector<uint32_t> order_;
  std::vector<Node> nodes_;
  std::vector<int> next_, previous_, behind_;
};

}  // namespace

std::vector<Triangle> delaunay(std::span<const IntPoint> points) { return Triangulation(points).triangles(); }

}  // namespace lf
