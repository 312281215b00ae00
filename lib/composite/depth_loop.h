// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstdint>
#include <deque>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "base/memory.h"
#include "focus/view_depths.h"
#include "rig/rig.h"
#include "view/view_request.h"

namespace lf {

// The compositor's part of the depth search. It estimates a depth map for a moving view, one step with each picture.
// Each request contains depth hypotheses (guessed depths). The nodes answer with photo-consistency sums, which show how
// well the cameras agree about each guess. The loop adds the sums of all nodes, and selects the depths and the next
// guesses for the next request.
//
// Use this class if the viewer applies an estimate as soon as it is ready; each request names the estimate that it
// uses. Use ViewDepths instead if the viewer waits for each estimate. Not thread-safe.
class DepthLoop {
 public:
  // The maximum number of requests with late sums, and the maximum wait for the sums of a request, in pictures.
  static constexpr size_t kMaxPending = 8;
  static constexpr unsigned kPatience = 12;
  // Number of requests without a new estimate, after a client did not use the latest estimate.
  static constexpr unsigned kRetryInterval = 15;

  // Clears everything except the rig.
  void clear();
  // Sets the rig of the answering array, which defines where distances start. If the rig is null (unknown), distances
  // start at an arbitrary fixed plane.
  void set_rig(std::shared_ptr<const Rig> rig);

  // Starts the next request, and discards the answers to the previous request.
  void begin();
  // The result of take(). `ahead` is the request that the sums belong to: the current request (0), a later request (>
  // 0) or an earlier request (< 0). `problem` is an error message for the user, or empty.
  struct Taken {
    int32_t ahead = 0;
    std::string problem;
  };
  // The sums of earlier requests are kept for a later call of next(), if they were missing from their pictures.
  Taken take(std::span<const uint8_t> unit, const ViewRequest& request);
  // Returns the received photo-consistency sums as messages of a single node, for a compositor that answers another
  // compositor. These messages must be sent before the answer of this node. The result is empty if no sums have
  // arrived.
  std::vector<ByteBuffer> units(const ViewRequest& request, uint64_t rig_hash, uint32_t node) const;

  // Adapts how often requests contain depth hypotheses, because these cost the nodes time. At most one request in
  // `interval` will contain some. `complete` means that the nodes answered in time for the picture; if not,
  // hypotheses become less frequent. Call this before next().
  void adapt_rate(bool complete, unsigned interval);
  // Returns the depths and hypotheses for the next request, or nothing if the next request can use the same as
  // `request`. They are based on an earlier request if its sums were late. If `match_gains` is true, the estimate also
  // includes exposure compensation, as far as pixels mix several cameras.
  std::optional<DepthEstimate> next(const ViewRequest& request, const DepthEstimator::Settings& settings,
                                    bool match_gains);
  // Records whether a client has used the result of next(). If no client uses the results, for example because the
  // requests come from a file, the loop searches for depths only now and then, to save time.
  void set_accepted(bool accepted) { requests_until_retry_ = accepted ? 0 : kRetryInterval; }
  // Returns the depths that a sweep has found. A sweep is one request with planes at many distances as hypotheses, for
  // example for a click on the picture. `sweep` is this request, which must be the current request.
  DepthEstimate sweep(const ViewRequest& sweep) const;

  const DepthEstimator::State& state() const { return control_.state(); }
  // Returns the confidence of the latest surface: see DepthEstimator::confidence().
  std::shared_ptr<const FocalMap> confidence() const { return control_.confidence(); }
  uint64_t bytes() const { return bytes_; }

 private:
  struct Pending {
    ViewRequest request;
    ViewDepths::Answers answers;
    unsigned age = 0;  // pictures since its own
  };
  std::optional<Pending> take_pending(const ViewRequest& request);

  std::shared_ptr<const Rig> rig_;
  ViewDepths::Answers answers_;
  uint64_t bytes_ = 0;
  DepthEstimator::Settings settings_;
  DepthEstimator control_;
  std::optional<FocusArray> array_;
  ExposureSchedule exposure_schedule_;
  bool is_complete_ = true;            // see adapt_rate()
  std::deque<Pending> pending_;        // requests without an estimate, in the order of sending
  unsigned requests_until_retry_ = 0;  // number of requests until the next search
};

}  // namespace lf
