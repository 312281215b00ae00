// SPDX-License-Identifier: LGPL-2.1-or-later
#include "rig/hole_filling.h"

#include <algorithm>
#include <map>
#include <utility>

namespace lf {
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
  // Thinner than a quantum: no direction but noise.
  if (glm::dot(area, area) <= centres.quantum * centres.quantum * longest2) return plane;
  return plane_with_normal(area, plane);
}

// A box in local coordinates, in quanta.
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

  // The edges that a filled bay could run into: near the chain in depth as well, so that the far side of a cylinder
  // does not count.
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
    // Inside a ring there is nothing else.
    const std::vector<MeshEdge> around = part.closed ? std::vector<MeshEdge>{} : filler.edges_near(part, faces, link);
    const std::vector<Triangle> filled = clip_ears(filler.outline(part), around);
    faces.insert(faces.end(), filled.begin(), filled.end());
  }
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
      ears.push_back(lowest_first({camera(vertices_[tip].previous), camera(tip), camera(vertices_[tip].next)}));
      clip(tip);
    }
    return ears;
  }

 private:
  struct Vertex {
    int previous = 0, next = 0;
    bool is_end = false;  // of a chain: never a tip
    bool clipped = false;
    bool possible = false;  // as a tip: left turn, clear of the mesh around
    int contained = 0;      // vertices of the outline that the triangle contains
    int in_circle = 0;      // vertices of the outline inside its circumcircle
  };

  IntPoint at(int i) const { return outline_.at[i]; }
  CameraIndex camera(int i) const { return outline_.camera[i]; }

  bool contains(const Vertex& v, IntPoint tip, IntPoint p) const {
    const IntPoint a = at(v.previous), b = at(v.next);
    return p != a && p != tip && p != b && in_closed_triangle(a, tip, b, p);
  }

  bool is_clear(const Vertex& v, int tip) const {
    for (const MeshEdge& e : around_) {
      if (contains(v, at(tip), e.from_at) || contains(v, at(tip), e.to_at)) return false;
      if (cross_properly(at(v.next), at(v.previous), e.from_at, e.to_at)) return false;
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
  // Goes on from the last camera along edges not walked yet, whichever way these turn.
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
  std::map<CameraIndex, std::vector<size_t>> at_;  // edges that end in a camera
};

}  // namespace

std::vector<LinkPart> camera_link(std::span<const Triangle> star, CameraIndex camera) {
  LinkWalker walker(star, camera);
  if (!walker.is_surface()) return {};
  return walker.parts();
}

}  // namespace lf
