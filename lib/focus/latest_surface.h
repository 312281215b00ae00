// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstddef>
#include <deque>
#include <memory>
#include <vector>

#include "focus/surface_choice.h"
#include "focus/trial_levels.h"
#include "view/view_request.h"

namespace lf {

// The surface of a view that rounds of trials have come to. Pictures may take longer than requests are apart: then a
// round is made of a surface that does not know yet what came of those just before it, and must not undo it. So what
// each node was decided by is kept, with its cost: where a round that the request did not know of found something
// better, that stays. Where every request waits for what came of the one before, a round's own choice is the surface. A
// plain value without locks.
class LatestSurface {
 public:
  static constexpr size_t kMostUnderway = 64;  // requests; older ones are thought to be lost

  // Rounds that requests are underway for.
  size_t underway() const { return underway_.size(); }
  // A request is going to leave with these trials, of the surface as it is now.
  void leaves(const std::vector<Trial>& trials);
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
    unsigned rounds;  // that its surface knows of
  };
  std::deque<Underway> underway_;
  unsigned rounds_ = 0;
  View view_;
  // Of each node: the deviation that it was chosen for, and the round that moved it last. They stay where they are when
  // the eye moves, as the steps of a moving eye are small beside a node.
  std::vector<float> cost_;
  std::vector<unsigned> moved_;
};

}  // namespace lf
