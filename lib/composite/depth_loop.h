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

// Estimates the depths for the next request of a view from the nodes' answers to the current depth hypotheses. For
// viewers that apply an estimate when they can; their requests show which estimate they carry. (ViewDepths is for
// viewers that wait.) Not thread-safe.
class DepthLoop {
 public:
  // Requests without a search after an estimate was not used: a second or less.
  static constexpr unsigned kUnheardInterval = 15;

  // Keeps the rig.
  void clear();
  // Sets the rig of the answering array. Null: unknown; distances then count from an arbitrary fixed plane.
  void set_rig(std::shared_ptr<const Rig> rig);

  // Starts the next request: discards the answers to the previous request.
  void begin();
  // The result of take(): the request that a photo-consistency unit belongs to, relative to the current request (> 0:
  // later, 0: current, < 0: earlier), and an error text ("": none).
  struct Taken {
    int32_t ahead = 0;
    std::string problem;
  };
  Taken take(std::span<const uint8_t> unit, const ViewRequest& request);
  // Returns the received photo-consistency sums as units of one node, for a compositor tree; empty if none have
  // arrived. They precede the node's answer.
  std::vector<ByteBuffer> units(const ViewRequest& request, uint64_t rig_hash, uint32_t node) const;

  // Call before next(). `complete`: the picture was complete in time. `interval`: at most one request in `interval`
  // carries depth hypotheses.
  void adapt_rate(bool complete, unsigned interval);
  // Returns the estimate for the next request; nothing if there is no update. `match_gains`: match the cameras'
  // exposure where several cameras make the picture.
  std::optional<DepthEstimate> next(const ViewRequest& request, const DepthEstimator::Settings& settings,
                                    bool match_gains);
  // Tells whether a client has used the result of next(). If none does (for example if requests come from a file), the
  // search runs only now and then.
  void heard(bool heard) { unheard_ = heard ? 0 : kUnheardInterval; }
  // Returns the in-focus depths of a sweep. `sweep`: the current request, with hypotheses independent of the view.
  DepthEstimate sweep(const ViewRequest& sweep) const;

  const DepthEstimator::State& state() const { return control_.state(); }
  uint64_t bytes() const { return bytes_; }  // since begin()

 private:
  std::shared_ptr<const Rig> rig_;
  ViewDepths::Answers answers_;
  uint64_t bytes_ = 0;
  DepthEstimator::Settings settings_;
  DepthEstimator control_;
  std::optional<FocusArray> array_;
  ExposureSchedule exposure_schedule_;
  unsigned unheard_ = 0;  // requests until the next search
};

}  // namespace lf
