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

// Detects ambiguous depths, for example in front of a repeated pattern, where the cameras agree through a wrong depth
// as well as through the right depth. The class keeps, for each node of the focal map, the two planes with the least
// deviation that are clearly apart. It collects them from all searches and sweeps (see DepthEstimator), and then
// estimates the error of the picture in case the surface is at the wrong one of two depths. A plain value without
// locks.
class DepthAmbiguity {
 public:
  // `apart` is the smallest difference between two inverse distances, in 1/m, that counts as a different depth. A
  // smaller difference moves an image by less than the distance between two nodes.
  explicit DepthAmbiguity(double apart = 0) : apart_(apart) {}

  // The order of a request's hypotheses.
  struct Sweep {
    size_t plane;  // index of the viewer's focal plane
    size_t first;  // index of the first plane with a single level; all later hypotheses are such planes
  };
  // Adds the results of one request. `levels` and `moments` each have one element for each hypothesis of the request.
  // If earlier results belong to a different view, they are discarded first.
  void add(const View& view, std::span<const std::vector<uint8_t>> levels, std::span<const PhotoConsistency> moments,
           const Sweep& of);

  void clear() { nodes_.clear(); }
  // Discards the depths outside this range of inverse distances, in 1/m, because the scene has no objects there.
  void forget_beyond(double farthest, double nearest);

  // Estimated errors of two pictures, through the surface and through the viewer's focal plane. The estimate assumes
  // the worst case: the surface is wrong wherever another depth explains the images as well. All but `known` are means
  // over the nodes that all cameras see both ways and where the picture through the viewer's plane has not changed
  // since add(). `surface` and `plane` are mean squared errors, and `surface_disagrees` and `plane_disagrees` are the
  // mean squared deviations between the cameras; all are in squared luma levels. `known` is the fraction of the visible
  // nodes that these means cover.
  struct Errors {
    double surface = 0, plane = 0;
    double surface_disagrees = 0, plane_disagrees = 0;
    double known = 0;
  };
  // Estimates the errors for one request. `levels` are the levels of the surface, and `surface` and `plane` are the
  // sums through the surface and through the viewer's plane. All errors are 0 if `view` is not the view of the last
  // add().
  Errors errors(const View& view, std::span<const uint8_t> levels, const PhotoConsistency& surface,
                const PhotoConsistency& plane) const;

 private:
  struct Depth {
    float inverse = 0, cost, luma = 0;
  };
  struct Node {
    Depth best, other;
    float on_plane;  // mean luma through the viewer's plane; NaN: unknown
  };
  bool is_from(const View& view) const;

  double apart_;
  View view_;  // view of the last add(), without its map
  std::vector<Node> nodes_;
};

}  // namespace lf
