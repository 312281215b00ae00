// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "focus/photo_consistency.h"
#include "geometry/pose.h"
#include "view/view.h"

namespace lf {

// Remembers other depths that make the cameras agree as well as the surface does. Keeps the two best planes of each
// node that are clearly apart, from all searches and sweeps. A plain value.
class DepthAmbiguity {
 public:
  // `apart`: smallest difference of two distinct depths, 1/m. A smaller one moves no image by more than a node.
  explicit DepthAmbiguity(double apart = 0) : apart_(apart) {}

  // Adds the results of a request with planes: `levels` and `moments` of its hypotheses, where `plane` is the index of
  // the viewer's plane, and `first` that of the first plane at a single level. Discards earlier results of another
  // view.
  struct Sweep {
    size_t plane, first;
  };
  void add(const View& view, std::span<const std::vector<uint8_t>> levels, std::span<const PhotoConsistency> moments,
           const Sweep& of);

  void clear() { nodes_.clear(); }
  // Discards the depths outside these inverse distances, 1/m.
  void forget_beyond(double farthest, double nearest);

  // Mean squared errors, squared luma levels, of the pictures through the surface and through the viewer's plane,
  // assuming that the surface is wrong wherever another depth explains the images as well. `surface_disagrees` and
  // `plane_disagrees`: mean squared deviations of the cameras over the same nodes. `known`: the fraction of the visible
  // nodes that these means cover. These are the nodes that all cameras see both ways, and where the viewer's plane
  // shows the same as during add().
  struct Errors {
    double surface = 0, plane = 0;
    double surface_disagrees = 0, plane_disagrees = 0;
    double known = 0;
  };
  // `levels`, `surface` and `plane` belong to one request. All errors are 0 if `view` is not the view of the last
  // add().
  Errors errors(const View& view, std::span<const uint8_t> levels, const PhotoConsistency& surface,
                const PhotoConsistency& plane) const;

 private:
  struct Depth {
    float inverse = 0, cost, luma = 0;
  };
  struct Node {
    Depth best, other;
    float on_plane;  // luma through the viewer's plane; NaN: unknown
  };
  bool is_from(const View& view) const;

  double apart_;
  View view_;  // view of the last add(), without its map
  std::vector<Node> nodes_;
};

}  // namespace lf
