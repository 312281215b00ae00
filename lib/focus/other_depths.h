// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "focus/moments.h"
#include "geometry/pose.h"
#include "view/view.h"

namespace lf {

// Remembers at which other depths the cameras agree as well as through the surface. Where things repeat, or a thing is
// seen past by all cameras, a surface can agree and show what is not there: all that tells is that something else would
// have agreed, too. So all planes of searches and sweeps are remembered: of each node the two best ones that are
// clearly apart. A plain value.
class OtherDepths {
 public:
  // `apart`, 1/m: depths that differ by less are the same one, which moves no picture by more than a node.
  explicit OtherDepths(double apart = 0) : apart_(apart) {}

  // What came of a request with planes: `levels` and `moments` of its trials, of which `plane` is the viewer's plane
  // and those from `first` on are planes all over. What is known from elsewhere is forgotten.
  struct Sweep {
    size_t plane, first;
  };
  void add(const View& view, std::span<const std::vector<uint8_t>> levels, std::span<const Moments> moments,
           const Sweep& of);

  void clear() { nodes_.clear(); }
  // Forgets the depths outside of these inverse distances, 1/m.
  void forget_beyond(double farthest, double nearest);

  // Mean squared errors, levels of luma squared, of the picture through a surface and of the one through the viewer's
  // plane if the surface is wrong wherever another depth explains as well what the cameras see; and how far cameras
  // disagree through the two, over the same nodes. `known`: the part of the nodes that any camera sees that this is
  // told from: where all cameras see both, and the viewer's plane shows what it did when planes were tried.
  struct Errors {
    double surface = 0, plane = 0;
    double surface_disagrees = 0, plane_disagrees = 0;
    double known = 0;
  };
  // `levels`, `surface`, `plane`: of one request from where planes were tried; otherwise nothing is known.
  Errors errors(const View& view, std::span<const uint8_t> levels, const Moments& surface, const Moments& plane) const;

 private:
  struct Depth {
    float inverse = 0, cost, luma = 0;
  };
  struct Node {
    Depth best, other;
    float on_plane;  // luma through the viewer's plane, NaN: not known
  };
  bool is_from(const View& view) const;

  double apart_;
  View view_;  // the view that planes were tried for; its map has only the range of the nodes' depths
  std::vector<Node> nodes_;
};

}  // namespace lf
