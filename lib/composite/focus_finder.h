// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "base/byte_buffer.h"
#include "focus/view_focus.h"
#include "rig/rig.h"
#include "view/view_request.h"

namespace lf {

// Finds where the next request of a view is to be focused, from what nodes answer to the trials of the request that has
// its turn. For viewers that take what was found when they can: the plan is told, and which requests carry it is seen
// from them (ViewFocus is for those who wait). Not thread-safe.
class FocusFinder {
 public:
  static constexpr unsigned kUnheardRest = 15;  // requests: a second or less

  // As new.
  void clear();
  // Of the array that answers; null: not known, then any plane serves that stays where it is.
  void set_rig(std::shared_ptr<const Rig> rig);

  // A request has its turn: what came of the one before is forgotten.
  void begin();
  // What a unit of moments was: of a request so many later (> 0), of the one that has its turn, or of none any more
  // (< 0); and what is wrong with it, empty: nothing.
  struct Taken {
    int32_t ahead = 0;
    std::string problem;
  };
  Taken take(std::span<const uint8_t> unit, const ViewRequest& request);
  // What has come, as units of one node: what goes before its answer in a tree, nothing if nothing has.
  std::vector<ByteBuffer> units(const ViewRequest& request, uint64_t rig_hash, uint32_t node) const;

  // How the request before next() went: whether its picture was complete in time. At most one in `interval` is to have
  // trials.
  void keep_pace(bool complete, unsigned interval);
  // What the next request is to have; nothing where there is nothing to say. `match_gains`: of cameras, where several
  // make the picture.
  std::optional<FoundFocus> next(const ViewRequest& request, const FocusControl::Settings& settings, bool match_gains);
  // Whether anybody has taken that. Where nobody does, as where requests come from a file, it is looked for again now
  // and then.
  void heard(bool heard) { unheard_ = heard ? 0 : kUnheardRest; }
  // Where a sweep of depths, a request with trials beside those of the view, is in focus.
  FoundFocus sweep(const ViewRequest& sweep) const;

  const FocusControl::State& state() const { return control_.state(); }
  uint64_t bytes() const { return bytes_; }  // of the units taken since begin()

 private:
  std::shared_ptr<const Rig> rig_;
  ViewFocus::Answers answers_;  // to the trials, and to the question for the mean brightness
  uint64_t bytes_ = 0;
  FocusControl::Settings settings_;
  FocusControl control_;
  std::optional<FocusArray> array_;
  MeanTurns mean_turns_;
  unsigned unheard_ = 0;  // requests for which nothing is looked for yet
};

}  // namespace lf
