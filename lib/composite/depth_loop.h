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

// Estimates the depth map of a view. Each request carries depth hypotheses, the nodes answer with photo-consistency
// sums, and the loop computes the depths for the next request from these sums. Use this class if the viewer applies
// estimates when it can; its requests tell which estimate they use. (ViewDepths is for viewers that wait for each
// estimate.) Not thread-safe.
class DepthLoop {
 public:
  // Number of requests without a search after an estimate was not used; a second or less.
  static constexpr unsigned kUnheardInterval = 15;

  // Clears everything except the rig.
  void clear();
  // Sets the rig of the answering array. If it is null (unknown), distances count from an arbitrary fixed plane.
  void set_rig(std::shared_ptr<const Rig> rig);

  // Starts the next request, and discards the answers to the previous request.
  void begin();
  // The result of take(). `ahead` tells which request the sums belong to: the current one (0), a later one (> 0) or an
  // earlier one (< 0). `problem` is an error text, or "".
  struct Taken {
    int32_t ahead = 0;
    std::string problem;
  };
  Taken take(std::span<const uint8_t> unit, const ViewRequest& request);
  // Returns the received photo-consistency sums as messages of one node, for a compositor inside a tree. They must be
  // sent before the answer of this node. Empty if none have arrived.
  std::vector<ByteBuffer> units(const ViewRequest& request, uint64_t rig_hash, uint32_t node) const;

  // Adapts how often requests carry depth hypotheses: at most one in `interval` requests. `complete` means that the
  // picture was complete in time. Call before next().
  void adapt_rate(bool complete, unsigned interval);
  // Returns the estimate for the next request, or nothing if there is no update. `match_gains` also matches the
  // cameras' exposure where several cameras make the picture.
  std::optional<DepthEstimate> next(const ViewRequest& request, const DepthEstimator::Settings& settings,
                                    bool match_gains);
  // Tells whether a client has used the result of next(). If no client does, for example because requests come from a
  // file, the search only runs now and then.
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
