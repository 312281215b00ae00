// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "base/memory.h"
#include "focus/view_focus.h"
#include "rig/rig.h"
#include "view/view_request.h"

namespace lf {

// Finds where the next request of a view is to be focused, from what nodes answer to the trials of the request that has
// its turn. For viewers that take what was found when they can: the plan is told, and which requests carry it is seen
// from them (ViewFocus is for those who wait). Not thread-safe.
class FocusFinder {
 public:
  // Requests without a search after what was found was not heard: a second or less.
  static constexpr unsigned kUnheardRest = 15;

  // Forgets everything, as if it were new.
  void clear();
  // Sets the rig of the array that answers; null: not known, then distances count from any plane that stays where it
  // is.
  void set_rig(std::shared_ptr<const Rig> rig);

  // The next request has its turn: answers to the one before are forgotten.
  void begin();
  // What a unit of moments answers: a request so many later (> 0), the one that has its turn (0), or an earlier one (<
  // 0); and what is wrong with it, "": nothing.
  struct Taken {
    int32_t ahead = 0;
    std::string problem;
  };
  Taken take(std::span<const uint8_t> unit, const ViewRequest& request);
  // The moments that have come, as units of one node, which go before its answer in a tree; empty if none have.
  std::vector<ByteBuffer> units(const ViewRequest& request, uint64_t rig_hash, uint32_t node) const;

  // Call before next(): whether the request's picture was complete in time, and that at most one request in `interval`
  // is to have trials.
  void keep_pace(bool complete, unsigned interval);
  // What the next request is to have; nothing where there is nothing to say. `match_gains`: of cameras, where several
  // make the picture.
  std::optional<FoundFocus> next(const ViewRequest& request, const FocusControl::Settings& settings, bool match_gains);
  // Tells whether anybody has taken what next() gave. Where nobody does, as where requests come from a file, it is
  // looked for again now and then.
  void heard(bool heard) { unheard_ = heard ? 0 : kUnheardRest; }
  // Where a sweep of depths is in focus: `sweep` is a request with trials, beside those of the view, that has its turn.
  FoundFocus sweep(const ViewRequest& sweep) const;

  const FocusControl::State& state() const { return control_.state(); }
  uint64_t bytes() const { return bytes_; }  // bytes of the units taken since begin()

 private:
  std::shared_ptr<const Rig> rig_;
  ViewFocus::Answers answers_;  // answers to the trials, and to the question for the mean brightness
  uint64_t bytes_ = 0;
  FocusControl::Settings settings_;
  FocusControl control_;
  std::optional<FocusArray> array_;
  MeanTurns mean_turns_;
  unsigned unheard_ = 0;  // requests to go until something is looked for again
};

}  // namespace lf
