// SPDX-License-Identifier: LGPL-2.1-or-later
#include "rig/ear_clipping.h"

#include <algorithm>
#include <utility>

namespace lf {
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

}  // namespace lf
