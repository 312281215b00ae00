// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <optional>
#include <span>

#include "focus/focus_control.h"

namespace lf {

// The focal surface of one view from request to request, for those whose requests wait for what came of the one before:
// FocusControl with its plan on the way into the next request. A plain value without locks.
class ViewFocus {
 public:
  explicit ViewFocus(const FocusControl::Settings& settings = {}) : settings_(settings), control_(settings) {}

  const FocusControl::Settings& settings() const { return settings_; }
  // Gives a request, whose view has no map, the surface as its view has it, and what is to be tried with it.
  void apply(ViewRequest& request) const;
  // What came of such a request: moments of its trials, in their order; empty where nothing came. `complete`: so was
  // its picture.
  void take(const ViewRequest& request, std::span<const Moments> moments, const FocusArray& array,
            bool complete = true);

 private:
  FocusControl::Settings settings_;
  FocusControl control_;
  std::optional<FocusControl::Plan> plan_;
};

}  // namespace lf
