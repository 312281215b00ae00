// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstdint>
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

// Estimates the depth map of a moving view, one step per picture. Each request carries depth hypotheses (guesses of the
// depths). The nodes answer with photo-consistency sums, which show how well the cameras agree on each guess. The loop
// selects the best depths from these sums for the next request.
//
// Use this class if the viewer applies an estimate as soon as it is ready; each request names the estimate that it
// uses. Use ViewDepths instead if the viewer waits for each estimate. Not thread-safe.
class DepthLoop {
 public:
  // Number of requests without depth hypotheses after an estimate was not used.
  static constexpr unsigned kUnheardInterval = 15;

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
  Taken take(std::span<const uint8_t> unit, const ViewRequest& request);
  // Returns the received photo-consistency sums as messages of a single node, for a compositor that answers another
  // compositor. These messages must be sent before the answer of this node. The result is empty if no sums have
  // arrived.
  std::vector<ByteBuffer> units(const ViewRequest& request, uint64_t rig_hash, uint32_t node) const;

  // Adapts how often requests carry depth hypotheses: at most one request in `interval`. `complete` means that all
  // cameras answered in time for the picture. Call this before next().
  void adapt_rate(bool complete, unsigned interval);
  // Returns the new depth estimate for the next request, or nothing if there is no update. If `match_gains` is true,
  // the estimate also corrects differences of the cameras' exposure in pictures that several cameras contribute to.
  std::optional<DepthEstimate> next(const ViewRequest& request, const DepthEstimator::Settings& settings,
                                    bool match_gains);
  // Records whether a client has used the result of next(). If no client uses the results, for example because the
  // requests come from a file, the loop searches for depths only now and then, to save time.
  void heard(bool heard) { unheard_ = heard ? 0 : kUnheardInterval; }
  // Returns the depths in focus from a focus sweep. `sweep` is the current request; its hypotheses must not depend on
  // the view.
  DepthEstimate sweep(const ViewRequest& sweep) const;

  const DepthEstimator::State& state() const { return control_.state(); }
  uint64_t bytes() const { return bytes_; }

 private:
  std::shared_ptr<const Rig> rig_;
  ViewDepths::Answers answers_;
  uint64_t bytes_ = 0;
  DepthEstimator::Settings settings_;
  DepthEstimator control_;
  std::optional<FocusArray> array_;
  ExposureSchedule exposure_schedule_;
  unsigned unheard_ = 0;  // number of requests until the next search
};

}  // namespace lf
