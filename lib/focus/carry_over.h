// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstddef>
#include <cstdint>
#include <deque>
#include <memory>
#include <optional>
#include <vector>

#include "focus/surface_choice.h"
#include "focus/trial_levels.h"
#include "geometry/pose.h"
#include "view/view.h"
#include "view/view_request.h"

namespace lf {

// Finds where the nodes of a view's focal map are in the map of another view of the same scene, in SIMD vectors: the
// same places to the bit with every instruction set. Not thread-safe.
class CarriedNodes {
 public:
  // `from` has a map; `columns`, `rows`: of the map of `to`, which has the same step.
  CarriedNodes(const View& from, const View& to, int columns, int rows);

  // For each node of a row the other map's nodes that it covers, [left, right) x [top, bottom): none where the other
  // view does not see it. A node covers those whose middles it reaches over, as large as the other view sees it so that
  // what comes nearer has no holes, and the one that its own middle lies in. Valid until the next call.
  struct Row {
    const int32_t *left, *right, *top, *bottom;
  };
  Row row(int j);

  // What takes a line of sight (u, v, 1) of `from` and a level to a position among the other map's nodes.
  struct Geometry {
    double to_from_view[9];                         // row-major
    double offset[3], normal[3];                    // offset in coordinates of `to`, normal in those of `from`
    double eye, farthest, range;                    // inverse distance = farthest + range x (level / 255)
    double fx, fy, cx, cy, k1, k2, p1, p2, max_r2;  // the lens of `to`
    bool distorted;
    double zoom, per_step, columns, rows;
  };

 private:
  const View& from_;
  Geometry geometry_;
  std::vector<double> u_, v_;  // lines of sight of the latest row's nodes
  std::vector<int32_t> left_, right_, top_, bottom_;
};

// The focal map of `from` as another view of the same scene has it: what each node is in focus at moves to where the
// other view sees it. Where several nodes meet the nearest wins, where none does the farther of the neighbours along
// the row: what comes into sight behind an edge is the background. The map itself if the view is the same, null if it
// would have more than FocalMap::kMaxNodes. `from` has a map.
std::shared_ptr<const FocalMap> carry_over(const View& from, const View& to);

// The surface of a view that rounds of trials have come to. Pictures may take longer than requests are apart: then a
// round is made of a surface that does not know yet what came of those just before it, and must not undo it. So what
// each node was decided by is kept, with its cost: where a round that the request did not know of found something
// better, that stays. Where every request waits for what came of the one before, a round's own choice is the surface. A
// plain value without locks.
class LatestSurface {
 public:
  static constexpr size_t kMostUnderway = 64;  // requests without an answer; older ones are thought to be lost
  // Requests are thought to be lost, too, that wait for so many requests more than twice as long as any answered one
  // has.
  static constexpr uint32_t kPatience = 8;

  // How many requests with trials are underway.
  size_t underway() const { return underway_.size(); }
  // A request is going to leave with these trials, of the surface as it is now that the request `sequence` was
  // answered.
  void leaves(const std::vector<Trial>& trials, uint32_t sequence);
  // The request's trials are lost: no answer to them came, and none will.
  void lose(const ViewRequest& request);
  // Takes away the trials that are thought to be lost now that the request `sequence` was answered, in their order.
  std::vector<std::vector<Trial>> take_lost(uint32_t sequence);
  // Takes what came of a request's trials: `map` has the choice made for the request's view, and becomes the surface by
  // all that is known, in the map's own range.
  void merge(const ViewRequest& request, const SurfaceChoice& choice, FocalMap& map);
  // The surface is that of this view from now on.
  void set(const View& view) { view_ = view; }
  // The surface as another view has it; null if there is none.
  std::shared_ptr<const FocalMap> seen_from(const View& view) const;

 private:
  struct Underway {
    std::vector<Trial> trials;
    unsigned rounds;    // rounds that the surface of the request takes into account
    uint32_t sequence;  // number of the request that was answered last when this one was going to leave
  };
  std::optional<Underway> answered(const ViewRequest& request);
  std::deque<Underway> underway_;
  std::vector<std::vector<Trial>> lost_;
  std::optional<uint32_t> longest_;  // the most requests that left before one of them was answered
  unsigned rounds_ = 0;
  View view_;
  // For each node the deviation that it was chosen for, and the round that moved it last. They stay where they are when
  // the eye moves, as the steps of a moving eye are small beside a node.
  std::vector<float> cost_;
  std::vector<unsigned> moved_;
};

}  // namespace lf
