// SPDX-License-Identifier: LGPL-2.1-or-later
#include "rig/link.h"

#include <algorithm>
#include <map>
#include <utility>

namespace lf {
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
