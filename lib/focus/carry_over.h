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
#include "geometry/focal_surface.h"
#include "view/view.h"
#include "view/view_request.h"

namespace lf {

// Where the nodes of a view's focal map are in the map of another view of the same scene, in vectors. The same to the
// bit with every instruction set. Not thread-safe.
class CarriedNodes {
 public:
  // `from` has a map; `columns`, `rows`: of the other's, of the same step.
  CarriedNodes(const View& from, const View& to, int columns, int rows);

  // For each node of a row those that it covers, [left, right) x [top, bottom): none where the other view does not see
  // it. Those whose middles it reaches over, as large as it is seen from there so that what comes nearer has no holes,
  // and the one that its own middle lies in. Valid until the next call.
  struct Row {
    const int32_t *left, *right, *top, *bottom;
  };
  Row row(int j);

  // From a line of sight (u, v, 1) of `from` and a level to a position among the other's nodes.
  struct Geometry {
    double to_from_view[9];                         // row-major
    double offset[3], normal[3];                    // in coordinates of `to`, of `from`
    double eye, farthest, range;                    // inverse distance = farthest + range x (level / 255)
    double fx, fy, cx, cy, k1, k2, p1, p2, max_r2;  // of the lens of `to`
    bool distorted;
    double zoom, per_step, columns, rows;
  };

 private:
  const View& from_;
  Geometry geometry_;
  std::vector<double> u_, v_;  // of a row
  std::vector<int32_t> left_, right_, top_, bottom_;
};

// The focal map of `from` as another view of the same scene has it: what each node is in focus at moves to where the
// other view sees it. Where several meet the nearest wins, where none does the farther of the neighbours along the row:
// what comes into sight behind an edge is the background. The map itself if the view is the same. `from` has a map.
std::shared_ptr<const FocalMap> carry_over(const View& from, const View& to);

// The surface of a view that rounds of trials have come to. Pictures may take longer than requests are apart: then a
// round is made of a surface that does not know yet what came of those just before it, and must not undo it. So what
// each node was decided by is kept, with its cost: where a round that the request did not know of found something
// better, that stays. Where every request waits for what came of the one before, a round's own choice is the surface. A
// plain value without locks.
class LatestSurface {
 public:
  static constexpr size_t kMostUnderway = 64;  // requests; older ones are thought to be lost
  // And those that take so many requests more than twice as long as any answered one has.
  static constexpr uint32_t kPatience = 8;

  // Rounds that requests are underway for.
  size_t underway() const { return underway_.size(); }
  // A request is going to leave with these trials, of the surface as it is now that the request `sequence` was
  // answered.
  void leaves(const std::vector<Trial>& trials, uint32_t sequence);
  // Nothing came of a request's trials, and nothing will.
  void lose(const ViewRequest& request);
  // Trials of which nothing came, and nothing will, now that the request `sequence` was answered: those that were not
  // returned yet, in their order.
  std::vector<std::vector<Trial>> take_lost(uint32_t sequence);
  // What a request's trials came to: `map` has the choice for the request's view, and gets it for all that is known, in
  // its own range.
  void merge(const ViewRequest& request, const SurfaceChoice& choice, FocalMap& map);
  // The surface is that of this view from now on.
  void set(const View& view) { view_ = view; }
  // The surface as another view has it; null if there is none.
  std::shared_ptr<const FocalMap> seen_from(const View& view) const;

 private:
  struct Underway {
    std::vector<Trial> trials;
    unsigned rounds;    // that its surface knows of
    uint32_t sequence;  // of the request that was answered last when it was going to leave
  };
  std::optional<Underway> answered(const ViewRequest& request);
  std::deque<Underway> underway_;
  std::vector<std::vector<Trial>> lost_;
  std::optional<uint32_t> longest_;  // requests that the answer to one has taken
  unsigned rounds_ = 0;
  View view_;
  // For each node the deviation that it was chosen for, and the round that moved it last. They stay where they are when
  // the eye moves, as the steps of a moving eye are small beside a node.
  std::vector<float> cost_;
  std::vector<unsigned> moved_;
};

}  // namespace lf
