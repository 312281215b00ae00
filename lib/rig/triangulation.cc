// SPDX-License-Identifier: LGPL-2.1-or-later
#include "rig/triangulation.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <map>
#include <string>
#include <utility>

#include "base/text.h"

namespace lf {

namespace {

double largest_component(const Vec3& v) { return std::max({std::abs(v.x), std::abs(v.y), std::abs(v.z)}); }

int exponent_of(double v) {  // v is in [2^(e-1), 2^e)
  int e = 0;
  std::frexp(v, &e);
  return e;
}

// Scales by 2^-e so that the largest component is in [1/2, 1); returns e. At least one component must be non-zero.
int scale_to_unit(std::vector<Vec3>& points) {
  double reach = 0;
  for (const Vec3& p : points) reach = std::max(reach, largest_component(p));
  const int e = exponent_of(reach);
  for (Vec3& p : points) p = {std::ldexp(p.x, -e), std::ldexp(p.y, -e), std::ldexp(p.z, -e)};
  return e;
}

double length2(const Vec3& v) { return glm::dot(v, v); }

Vec3 unit(const Vec3& v) { return v / std::sqrt(length2(v)); }

}  // namespace

CameraCentres normalised_centres(std::span<const Vec3> positions) {
  CameraCentres centres;
  if (positions.empty()) return centres;
  double magnitude = 0;
  centres.at.reserve(positions.size());
  for (size_t i = 0; i < positions.size(); ++i) {
    if (!is_finite(positions[i])) throw Error("cameras[" + std::to_string(i) + "].position: must be finite numbers");
    // Subtracting a camera first is exact for arrays far from the origin. The factor 0.25 prevents overflow below.
    centres.at.push_back(0.25 * positions[i] - 0.25 * positions[0]);
    magnitude = std::max(magnitude, 0.25 * largest_component(positions[i]));
  }
  if (std::all_of(centres.at.begin(), centres.at.end(), [](const Vec3& c) { return c == Vec3(0); })) return centres;
  const int e = scale_to_unit(centres.at);
  Vec3 mean(0);
  for (const Vec3& c : centres.at) mean += c;
  mean /= static_cast<double>(positions.size());
  for (Vec3& c : centres.at) c -= mean;
  const int unit_exponent = e + scale_to_unit(centres.at);
  // A double of magnitude 2^k has an error of 2^(k-53); four times that leaves room for the rotation into the plane.
  centres.quantum = std::max(0x1p-23, std::ldexp(1.0, exponent_of(magnitude) - 51 - unit_exponent));
  return centres;
}

PlaneAxes principal_axes(std::span<const Vec3> points) {
  Vec3 mean(0);
  for (const Vec3& p : points) mean += p;
  if (!points.empty()) mean /= static_cast<double>(points.size());
  double s[3][3] = {};  // scatter matrix; becomes diagonal
  for (const Vec3& p : points) {
    const Vec3 d = p - mean;
    for (int i = 0; i < 3; ++i) {
      for (int j = 0; j < 3; ++j) s[i][j] += d[i] * d[j];
    }
  }
  Vec3 axis[3] = {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
  constexpr int kMaxSweeps = 32;  // converges quadratically, usually in 5 or 6 sweeps
  bool rotated = true;
  for (int sweep = 0; sweep < kMaxSweeps && rotated; ++sweep) {
    rotated = false;
    for (const auto& [p, q] : {std::pair{0, 1}, {0, 2}, {1, 2}}) {
      if (std::abs(s[p][q]) <= 0x1p-60 * (s[p][p] + s[q][q])) continue;
      rotated = true;
      const double theta = (s[q][q] - s[p][p]) / (2 * s[p][q]);
      const double t = (theta < 0 ? -1 : 1) / (std::abs(theta) + std::sqrt(theta * theta + 1));
      const double cosine = 1 / std::sqrt(t * t + 1), sine = t * cosine;
      const int r = 3 - p - q;
      const double spr = s[p][r], sqr = s[q][r], shift = t * s[p][q];
      s[p][p] -= shift;
      s[q][q] += shift;
      s[p][q] = s[q][p] = 0;
      s[p][r] = s[r][p] = cosine * spr - sine * sqr;
      s[q][r] = s[r][q] = sine * spr + cosine * sqr;
      const Vec3 ap = axis[p], aq = axis[q];
      axis[p] = cosine * ap - sine * aq;
      axis[q] = sine * ap + cosine * aq;
    }
  }
  int order[3] = {0, 1, 2};
  std::stable_sort(order, order + 3, [&](int a, int b) { return s[a][a] > s[b][b]; });
  PlaneAxes axes;
  axes.normal = unit(axis[order[2]]);
  axes.x = unit(axis[order[0]] - axes.normal * glm::dot(axes.normal, axis[order[0]]));
  axes.y = glm::cross(axes.normal, axes.x);
  return axes;
}

PlaneAxes best_fit_plane(std::span<const Vec3> points, const Vec3& right, const Vec3& forward) {
  PlaneAxes axes = principal_axes(points);
  if (glm::dot(axes.normal, forward) < 0) axes.normal = -axes.normal;
  const Vec3 upright = right - axes.normal * glm::dot(axes.normal, right);
  const double enough = 0.1 * static_cast<double>(points.size());
  if (length2(upright) > enough * enough) axes.x = unit(upright);
  axes.y = glm::cross(axes.normal, axes.x);
  return axes;
}

PlaneAxes plane_with_normal(const Vec3& normal, const PlaneAxes& reference) {
  PlaneAxes axes;
  axes.normal = unit(normal / largest_component(normal));
  const double along_x = glm::dot(axes.normal, reference.x);
  const Vec3& guide = along_x * along_x <= 0.5 ? reference.x : reference.y;
  axes.x = unit(guide - axes.normal * glm::dot(axes.normal, guide));
  axes.y = glm::cross(axes.normal, axes.x);
  return axes;
}

IntPoint quantise(const Vec3& centre, const PlaneAxes& axes, double quantum) {
  // |centre| <= sqrt(3) and quantum >= 2^-23, so this stays below 2^24.
  return {static_cast<int32_t>(std::floor(glm::dot(centre, axes.x) / quantum + 0.5)),
          static_cast<int32_t>(std::floor(glm::dot(centre, axes.y) / quantum + 0.5))};
}

bool are_collinear(const Vec3& a, const Vec3& b, const Vec3& c, double tolerance) {
  const Vec3 ab = b - a, ac = c - a, bc = c - b;
  const double longest2 = std::max({length2(ab), length2(ac), length2(bc)});
  return length2(glm::cross(ab, ac)) <= tolerance * tolerance * longest2;
}

namespace {

// Builds a first triangulation by adding points from left to right to their convex hull, then applies Lawson's flips
// (1977). Vertices are indices into the sorted order.
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
      result.push_back(canonical_triangle({order_[t.vertex[0]], order_[t.vertex[1]], order_[t.vertex[2]]}));
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

  void join(int t, int side, int u) {  // u has the same edge reversed, or is kNone
    nodes_[t].neighbour[side] = u;
    if (u == kNone) return;
    const int from = nodes_[t].vertex[(side + 1) % 3];
    for (int k = 0; k < 3; ++k) {
      if (nodes_[u].vertex[(k + 2) % 3] == from) nodes_[u].neighbour[k] = t;
    }
  }

  // The hull is a counter-clockwise ring of vertices; behind_[v] is the triangle at the edge v, next_[v]. Covers the
  // hull edge a, next_[a] with a triangle with apex p on its right.
  int cover(int a, int p) {
    const int t = static_cast<int>(nodes_.size()), b = next_[a];
    nodes_.push_back({{b, a, p}});
    join(t, 2, behind_[a]);
    return t;
  }

  void sweep() {
    const int n = static_cast<int>(order_.size());
    int first = 2;  // first point that is not collinear with the points before
    while (first < n && orientation(at(0), at(1), at(first)) == 0) ++first;
    if (first >= n) return;
    next_.assign(n, kNone);
    previous_.assign(n, kNone);
    behind_.assign(n, kNone);
    // A degenerate ring along the line and back. The side that faces the first non-collinear point is covered.
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

  // p is to the right of all earlier points and p - 1 is the rightmost of them, so the edges visible from p meet at p -
  // 1.
  void add(int p) {
    int low = p - 1, high = p - 1;  // visible chain, from low to high along the ring
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

  // For four cocircular points, prefers the diagonal with the lowest index. Flipping terminates: each flip lowers the
  // lifted surface, or gives the lowest of the four vertices an edge and takes edges only from higher vertices.
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
      // The four outer edges. They also cover stale entries for these edges.
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

namespace {

struct Edge {
  CameraIndex from, to;
  bool walked = false;
};

class LinkWalker {
 public:
  LinkWalker(std::span<const Triangle> star, CameraIndex camera) {
    for (const Triangle& t : star) {
      const auto corner = std::find(t.begin(), t.end(), camera) - t.begin();
      if (corner == 3 || t[0] == t[1] || t[1] == t[2] || t[2] == t[0]) continue;
      const Edge edge{t[(corner + 1) % 3], t[(corner + 2) % 3]};
      at_[edge.from].push_back(edges_.size());
      at_[edge.to].push_back(edges_.size());
      edges_.push_back(edge);
    }
  }

  bool is_surface() const {
    return std::all_of(at_.begin(), at_.end(), [](const auto& entry) { return entry.second.size() <= 2; });
  }

  std::vector<LinkPart> parts() {
    std::vector<LinkPart> result;
    for (Edge& edge : edges_) {
      if (edge.walked) continue;
      edge.walked = true;
      LinkPart part;
      part.camera = {edge.from, edge.to};
      walk(part.camera);
      if (part.camera.back() == edge.from) {
        part.camera.pop_back();
        part.closed = true;
      } else {
        std::vector<CameraIndex> before{edge.from};
        walk(before);
        part.camera.insert(part.camera.begin(), before.rbegin(), before.rend() - 1);
      }
      if (part.camera.size() >= 3) result.push_back(std::move(part));
    }
    return result;
  }

 private:
  void walk(std::vector<CameraIndex>& way) {
    for (bool moved = true; moved;) {
      moved = false;
      for (const size_t e : at_[way.back()]) {
        if (edges_[e].walked) continue;
        edges_[e].walked = true;
        way.push_back(edges_[e].from == way.back() ? edges_[e].to : edges_[e].from);
        moved = true;
        break;
      }
    }
  }

  std::vector<Edge> edges_;
  std::map<CameraIndex, std::vector<size_t>> at_;  // edges at each camera
};

}  // namespace

std::vector<LinkPart> camera_link(std::span<const Triangle> star, CameraIndex camera) {
  LinkWalker walker(star, camera);
  if (!walker.is_surface()) return {};
  return walker.parts();
}

namespace {

class EarClipper {
 public:
  EarClipper(const Outline& outline, std::span<const MeshEdge> around) : outline_(outline), around_(around) {
    const int n = static_cast<int>(outline.camera.size());
    vertices_.resize(n);
    for (int i = 0; i < n; ++i) vertices_[i] = {(i + n - 1) % n, (i + 1) % n};
    if (!outline.closed && n > 0) vertices_.front().is_end = vertices_.back().is_end = true;
    for (int i = 0; i < n; ++i) judge(i);
  }

  std::vector<Triangle> clip_all() {
    std::vector<Triangle> ears;
    for (size_t left = vertices_.size(); left >= 3; --left) {
      const int tip = best_ear();
      if (tip < 0) break;
      ears.push_back(canonical_triangle({camera(vertices_[tip].previous), camera(tip), camera(vertices_[tip].next)}));
      clip(tip);
    }
    return ears;
  }

 private:
  struct Vertex {
    int previous = 0, next = 0;
    bool is_end = false;  // end of a chain, never a tip
    bool clipped = false;
    bool possible = false;  // possible tip: left turn, clear of the surrounding mesh
    int contained = 0;
    int in_circle = 0;  // outline vertices inside its circumcircle
  };

  IntPoint at(int i) const { return outline_.at[i]; }
  CameraIndex camera(int i) const { return outline_.camera[i]; }

  bool contains(const Vertex& v, IntPoint tip, IntPoint p) const {
    const IntPoint a = at(v.previous), b = at(v.next);
    return p != a && p != tip && p != b && triangle_contains(a, tip, b, p);
  }

  bool is_clear(const Vertex& v, int tip) const {
    for (const MeshEdge& e : around_) {
      if (contains(v, at(tip), e.from_at) || contains(v, at(tip), e.to_at)) return false;
      if (segments_cross(at(v.next), at(v.previous), e.from_at, e.to_at)) return false;
      if (e.from == camera(v.next) && e.to == camera(v.previous)) return false;
    }
    return true;
  }

  void judge(int tip) {
    Vertex& v = vertices_[tip];
    v.possible = !v.is_end && orientation(at(v.previous), at(tip), at(v.next)) > 0 && is_clear(v, tip);
    v.contained = v.in_circle = 0;
    if (!v.possible) return;
    for (int i = v.next; i != tip; i = vertices_[i].next) count(v, tip, i, 1);
  }

  void count(Vertex& v, int tip, int other, int change) const {
    if (other == v.previous || other == v.next) return;
    if (contains(v, at(tip), at(other))) v.contained += change;
    if (in_circle(at(v.previous), at(tip), at(v.next), at(other)) > 0) v.in_circle += change;
  }

  int best_ear() const {
    int best = -1;
    for (int i = 0; i < static_cast<int>(vertices_.size()); ++i) {
      const Vertex& v = vertices_[i];
      if (v.clipped || !v.possible || v.contained > 0) continue;
      if (best < 0 || v.in_circle < vertices_[best].in_circle ||
          (v.in_circle == vertices_[best].in_circle && camera(i) < camera(best))) {
        best = i;
      }
    }
    return best;
  }

  void clip(int tip) {
    const auto [previous, next] = std::pair{vertices_[tip].previous, vertices_[tip].next};
    vertices_[tip].clipped = true;
    vertices_[previous].next = next;
    vertices_[next].previous = previous;
    for (int i = 0; i < static_cast<int>(vertices_.size()); ++i) {
      Vertex& v = vertices_[i];
      if (v.possible && !v.clipped && i != previous && i != next) count(v, i, tip, -1);
    }
    judge(previous);
    judge(next);
  }

  const Outline& outline_;
  std::span<const MeshEdge> around_;
  std::vector<Vertex> vertices_;
};

}  // namespace

std::vector<Triangle> clip_ears(const Outline& outline, std::span<const MeshEdge> around) {
  return EarClipper(outline, around).clip_all();
}

namespace {

// The plane of the triangles between `camera` and the edges of its link.
PlaneAxes local_plane(const LinkPart& part, const Vec3& centre, const CameraCentres& centres, const PlaneAxes& plane) {
  Vec3 area(0);
  double longest2 = 0;
  const size_t n = part.camera.size();
  for (size_t i = 0; i + (part.closed ? 0 : 1) < n; ++i) {
    const Vec3 a = centres.at[part.camera[i]] - centre, b = centres.at[part.camera[(i + 1) % n]] - centre;
    area += glm::cross(a, b);
    longest2 = std::max({longest2, glm::dot(a, a), glm::dot(b, b)});
  }
  // Thinner than a quantum: the direction is only noise.
  if (glm::dot(area, area) <= centres.quantum * centres.quantum * longest2) return plane;
  return plane_with_normal(area, plane);
}

struct Box {
  Vec3 low{HUGE_VAL}, high{-HUGE_VAL};
  void add(const Vec3& p) {
    low = glm::min(low, p);
    high = glm::max(high, p);
  }
  bool meets(const Box& o) const {
    return glm::all(glm::lessThanEqual(low, o.high)) && glm::all(glm::lessThanEqual(o.low, high));
  }
};

class HoleFiller {
 public:
  HoleFiller(const CameraCentres& centres, const PlaneAxes& local) : centres_(centres), local_(local) {}

  IntPoint at(CameraIndex camera) const { return quantise(centres_.at[camera], local_, centres_.quantum); }

  Outline outline(const LinkPart& part) const {
    Outline outline{part.camera, {}, part.closed};
    for (const CameraIndex camera : part.camera) outline.at.push_back(at(camera));
    return outline;
  }

  // Returns the edges that a filled bay could cross. Edges must be near the chain in depth as well, so that the far
  // side of a cylinder does not count.
  std::vector<MeshEdge> edges_near(const LinkPart& part, const std::vector<Triangle>& faces,
                                   const std::vector<LinkPart>& link) const {
    Box bay;
    for (const CameraIndex camera : part.camera) bay.add(place(camera));
    const double depth = std::max(bay.high.x - bay.low.x, bay.high.y - bay.low.y);
    bay.low.z -= depth;
    bay.high.z += depth;
    std::vector<MeshEdge> edges;
    const auto add = [&](CameraIndex from, CameraIndex to) { edges.push_back({from, to, at(from), at(to)}); };
    for (const Triangle& t : faces) {
      Box box;
      for (const CameraIndex camera : t) box.add(place(camera));
      if (!box.meets(bay)) continue;
      for (int k = 0; k < 3; ++k) add(t[k], t[(k + 1) % 3]);
    }
    for (const LinkPart& other : link) {
      if (&other == &part) continue;
      for (size_t i = 0; i + 1 < other.camera.size(); ++i) add(other.camera[i], other.camera[i + 1]);
    }
    return edges;
  }

 private:
  Vec3 place(CameraIndex camera) const {
    const IntPoint p = at(camera);
    return {p.x, p.y, glm::dot(centres_.at[camera], local_.normal) / centres_.quantum};
  }

  const CameraCentres& centres_;
  PlaneAxes local_;
};

}  // namespace

void remove_camera(std::vector<Triangle>& faces, CameraIndex camera, const CameraCentres& centres,
                   const PlaneAxes& plane) {
  const auto star_begin = std::stable_partition(
      faces.begin(), faces.end(), [&](const Triangle& t) { return std::find(t.begin(), t.end(), camera) == t.end(); });
  const std::vector<Triangle> star(star_begin, faces.end());
  faces.erase(star_begin, faces.end());
  const std::vector<LinkPart> link = camera_link(star, camera);
  for (const LinkPart& part : link) {
    const HoleFiller filler(centres, local_plane(part, centres.at[camera], centres, plane));
    // The inside of a ring is empty.
    const std::vector<MeshEdge> around = part.closed ? std::vector<MeshEdge>{} : filler.edges_near(part, faces, link);
    const std::vector<Triangle> filled = clip_ears(filler.outline(part), around);
    faces.insert(faces.end(), filled.begin(), filled.end());
  }
}

}  // namespace lf
