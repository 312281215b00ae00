// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <chrono>
#include <condition_variable>
#include <functional>
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
  // Gives the request the surface as its view has it, and the trials, which are for one request only; or what finds the
  // focus that was asked for. `from`: see FocalMap; asked for if need be.
  void apply(ViewRequest& request, const std::function<Plane()>& from);

  // A pixel of the view that is to be in focus. Its distance, if a surface is known; else the next requests ask for it.
  std::optional<double> focus_at(const Vec2& pixel);
  // The distance that was found since, once.
  std::optional<double> take_found();
  void set_unlocked(bool unlocked);
  void clear();

 private:
  std::mutex mutex_;
  std::condition_variable changed_;
  // Looks for the focus at a pixel by sweeps.
  struct Search {
    Vec2 pixel;
    std::optional<uint32_t> asked;  // the request that has the sweep
    std::optional<double> found;    // by the first stage
  };
  void see_sweep(const FocalSurfaceNews& news);

  std::optional<FocalSurfaceNews> news_;
  std::optional<Search> search_;
  std::optional<double> found_;
  bool unlocked_ = false;
};

}  // namespace lf
