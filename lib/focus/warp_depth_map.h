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

// Computes where the nodes of a view's focal map appear in the map of another view of the same scene, for warping the
// map. Uses SIMD, with the same bits for every instruction set. Not thread-safe.
class WarpedNodes {
 public:
  // Prepares warping from the view `from`, which must have a map, to the view `to`. The map of `to` has `columns` x
  // `rows` nodes, at the same distance in pixels.
  WarpedNodes(const View& from, const View& to, int columns, int rows);

  // For each node of a row, the range [left, right) x [top, bottom) of nodes in the other map that the node covers. The
  // range is empty if the node is not visible. A node covers all nodes with centres inside its footprint, and the node
  // that contains its own centre. The footprint has the node's size in the other view, so that approaching objects get
  // no holes. The arrays are valid until the next call.
  struct Row {
    const int32_t *left, *right, *top, *bottom;
  };
  Row row(int j);

  // The parameters of the mapping from a line of sight (u, v, 1) of `from` and a level to a position in the other map,
  // for the SIMD code.
  struct Geometry {
    double to_from_view[9];                         // row-major
    double offset[3], normal[3];                    // offset in coordinates of `to`, normal in coordinates of `from`
    double eye, farthest, range;                    // inverse distance = farthest + range x (level / 255)
    double fx, fy, cx, cy;                          // the lens of `to`
    Distortion<double> distortion;
    bool is_distorted;
    double zoom, per_step, columns, rows;
  };

 private:
  const View& from_;
  Geometry geometry_;
  std::vector<double> u_, v_;  // lines of sight of the latest row's nodes
  std::vector<int32_t> left_, right_, top_, bottom_;
};

// Warps the focal map of `from` to another view of the same scene, because the surface must stay in place when the
// viewpoint moves. If several nodes meet, the nearest one wins. Holes take the level of the farther neighbour along the
// row, because the background appears behind an edge. Returns the map itself if the views are the same, and null if the
// result would have more than FocalMap::kMaxNodes nodes. `from` must have a map.
std::shared_ptr<const FocalMap> warp_depth_map(const View& from, const View& to);

// Keeps the best known focal surface of a view, and improves the surface with the results of rounds of hypotheses.
// Several requests may be in flight at a time. The surface of a request then lacks the results of the rounds in flight,
// and its own result must not undo these results. Each node therefore remembers its deviation, and keeps a better
// result of a round that the request did not know. If every request waits for the previous answer, the surface is
// simply the result of the latest round. A plain value without locks.
class LatestSurface {
 public:
  static constexpr size_t kMaxInFlight = 64;  // maximum requests in flight; older requests count as lost
  // A request counts as lost after twice the longest wait of an answered request, plus this number of requests.
  static constexpr uint32_t kPatience = 8;

  // Returns the number of requests in flight.
  size_t underway() const { return underway_.size(); }
  // Registers a request with these hypotheses for the current surface. It is sent after the answer to request
  // `sequence`.
  void leaves(const std::vector<DepthHypothesis>& hypotheses, uint32_t sequence);
  // Marks the hypotheses of a request as lost, because they will not be answered.
  void lose(const ViewRequest& request);
  // Removes and returns the hypotheses that count as lost once request `sequence` is answered, in the order of their
  // requests.
  std::vector<std::vector<DepthHypothesis>> take_lost(uint32_t sequence);
  // Merges the result of a request's hypotheses. `map` is the surface that `choice` selects for the request's view. It
  // becomes the best known surface, in the same range of inverse distances.
  void merge(const ViewRequest& request, const DepthSelection& choice, FocalMap& map);
  // Sets the surface: a view with a map.
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
  // The deviation through the selected depth of each node, and the round of its last change. They are not warped when
  // the viewpoint moves, because it moves by less than a node between requests.
  std::vector<float> cost_;
  std::vector<unsigned> moved_;
};

}  // namespace lf
