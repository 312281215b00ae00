// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <chrono>
#include <condition_variable>
#include <deque>
#include <mutex>
#include <optional>

#include "focal_surface_event.h"
#include "rig/rig.h"

namespace lf {

// What a compositor says of the focal surface of lfviewrequest's view, on its way into the next request. Thread-safe.
class FocusFeedback {
 public:
  // Takes note of news of this view.
  void announce(FocalSurfaceNews news);
  // Waits until there are news from this request or a later one. False if that takes too long, or while unlocked.
  bool wait_for(uint32_t sequence, std::chrono::milliseconds longest);
  // Gives the request the surface as its view has it, and trials and gains, which are for one request only; or what
  // finds the focus that was asked for. `rig`: that the view is of; may be null.
  void apply(ViewRequest& request, const Rig* rig);

  // A place of the view that is to be in focus, as parts of its width and height. Its distance, if a surface is known;
  // else the next requests ask for it.
  std::optional<double> focus_at(const Vec2& place);
  // Whether that place (to begin with, the middle) is kept in focus from now on.
  void follow(bool follows);
  // The distance that was found since, once.
  std::optional<double> take_found();
  void set_unlocked(bool unlocked);
  void clear();

 private:
  // Looks for the focus at the place by sweeps.
  struct Search {
    std::optional<double> found;    // by the first stage; nothing: that is to come
    std::optional<uint32_t> asked;  // the request that has the sweep
    int lost = 0;                   // requests of which nothing came
  };
  void see_sweep(const FocalSurfaceNews& news);
  void find(double distance);
  std::optional<double> distance_in(const View& view) const;
  // Whether this request is to have a sweep.
  bool sweeps_with(uint32_t sequence);

  std::mutex mutex_;
  std::condition_variable changed_;
  std::optional<FocalSurfaceNews> news_;
  Vec2 place_{0.5, 0.5};
  bool follows_ = false;
  std::optional<Search> search_;
  std::deque<uint32_t> swept_;  // the latest requests with sweeps, the newest last: what comes of them is no surface
  std::optional<double> found_;
  std::optional<double> latest_;  // that was found at the place
  double now_ = 0;                // of the latest request
  bool unlocked_ = false;
};

}  // namespace lf
