// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <chrono>
#include <condition_variable>
#include <mutex>
#include <optional>

#include "focal_surface_event.h"

namespace lf {

// What a compositor says of the focal surface of lfviewrequest's view, on its way into the next request. Thread-safe.
class FocusFeedback {
 public:
  // Takes note of news of this view.
  void announce(FocalSurfaceNews news);
  // Waits until there are news from this request or a later one. False if that takes too long, or while unlocked.
  bool wait_for(uint32_t sequence, std::chrono::milliseconds longest);
  // Gives the request the surface as its view has it, and the trials, which are for one request only.
  void apply(ViewRequest& request);
  void set_unlocked(bool unlocked);
  void clear();

 private:
  std::mutex mutex_;
  std::condition_variable changed_;
  std::optional<FocalSurfaceNews> news_;
  bool unlocked_ = false;
};

}  // namespace lf
