// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstddef>
#include <cstdint>
#include <deque>
#include <memory>
#include <optional>
#include <vector>

#include "focus/depth_selection.h"
#include "focus/hypothesis_levels.h"
#include "geometry/pose.h"
#include "view/view.h"
#include "view/view_request.h"

namespace lf {

// Finds the positions of a focal map's nodes in the map of another view of the same scene, in SIMD: bit-identical with
// every instruction set. Not thread-safe.
class WarpedNodes {
 public:
  // `from` must have a map. `columns`, `rows`: size of the map of `to`, which has the same step.
  WarpedNodes(const View& from, const View& to, int columns, int rows);

  // For each node of a row, the range [left, right) x [top, bottom) of the other map's nodes that it covers; empty if
  // not visible. A node covers the nodes with centres inside its footprint, and the node that contains its own centre.
  // The footprint has the node's size in the other view, so that approaching objects have no holes. Valid until the
  // next call.
  struct Row {
    const int32_t *left, *right, *top, *bottom;
  };
  Row row(int j);

  // Maps a line of sight (u, v, 1) of `from` and a level to a position among the other map's nodes.
  struct Geometry {
    double to_from_view[9];                         // row-major
    double offset[3], normal[3];                    // offset in coordinates of `to`, normal in coordinates of `from`
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

// Returns the focal map of `from` as seen by another view of the same scene. The nearest node wins where several meet.
// Holes take the farther neighbour along the row, because the background appears behind an edge. Returns the map itself
// if the views are the same, and null if the result would have more than FocalMap::kMaxNodes nodes. `from` must have a
// map.
std::shared_ptr<const FocalMap> warp_depth_map(const View& from, const View& to);

// Merges the results of rounds of hypotheses into the latest surface of a view. Several requests may be in flight. A
// round then starts from a surface without the results of the previous rounds, and must not undo these results. Each
// node therefore keeps its cost, and a better result of a round unknown to the request remains. If every request waits
// for the previous answer, the round's selection is the surface. A plain value without locks.
class LatestSurface {
 public:
  static constexpr size_t kMaxInFlight = 64;  // requests in flight; older requests count as lost
  // Requests count as lost after twice the longest wait of an answered request plus this number of requests.
  static constexpr uint32_t kPatience = 8;

  size_t underway() const { return underway_.size(); }
  // Registers a request with these hypotheses for the present surface, sent after the answer to request `sequence`.
  void leaves(const std::vector<DepthHypothesis>& hypotheses, uint32_t sequence);
  // Marks the request's hypotheses as lost: they were not and will not be answered.
  void lose(const ViewRequest& request);
  // Removes and returns the hypotheses that count as lost after the answer to request `sequence`, in their order.
  std::vector<std::vector<DepthHypothesis>> take_lost(uint32_t sequence);
  // Merges the answer to a request's hypotheses. `map`: the selection for the request's view; becomes the best known
  // surface, in the map's own range.
  void merge(const ViewRequest& request, const DepthSelection& choice, FocalMap& map);
  void set(const View& view) { view_ = view; }
  // Returns the surface as seen by another view; null if there is none.
  std::shared_ptr<const FocalMap> seen_from(const View& view) const;

 private:
  struct Underway {
    std::vector<DepthHypothesis> hypotheses;
    unsigned rounds;    // rounds that the request's surface includes
    uint32_t sequence;  // number of the last request that was answered before this one was sent
  };
  std::optional<Underway> answered(const ViewRequest& request);
  std::deque<Underway> underway_;
  std::vector<std::vector<DepthHypothesis>> lost_;
  std::optional<uint32_t> longest_;  // longest wait of an answered request, in requests
  unsigned rounds_ = 0;
  View view_;
  // The deviation of each node's selection, and the round of its last change. They are not warped when the viewpoint
  // moves, because its steps are small relative to a node.
  std::vector<float> cost_;
  std::vector<unsigned> moved_;
};

}  // namespace lf
