// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <chrono>
#include <condition_variable>
#include <deque>
#include <map>
#include <mutex>
#include <optional>

#include "focus/view_focus.h"
#include "rig/rig.h"
#include "view/view_request.h"

namespace lf {

// What a compositor says of the focal surface of a view, on its way into the view's next request. Thread-safe.
class FocusFeedback {
 public:
  // Takes note of news of this view.
  void announce(FoundFocus news);
  // Waits until there are news from this request or a later one.
  enum class Waited { kCame, kTooLong, kUnlocked };
  Waited wait_for(uint32_t sequence, std::chrono::milliseconds longest);
  // Gives the request the surface as its view has it, and trials and gains, which are for one request only, and of a
  // set for the view that leads.
  void apply(ViewRequest& request);
  // Whether apply() would give a request trials now.
  bool has_trials();
  // What is to be asked for beside such a request to find the focus that is looked for: a small view around the place.
  // Its number is told once it has one. `rig`: that the view is of; may be null.
  std::optional<ViewRequest> next_sweep(const ViewRequest& request, const Rig* rig);
  void sweep_sent(uint32_t sequence);

  // A place of the view that is to be in focus, as parts of its width and height. Its distance, if a surface is known;
  // else the next requests ask for it. `seen`: the view that shows the place, one of a set, whose eyes look the same
  // way; null: the view itself, as it was when the surface was found.
  std::optional<double> focus_at(const Vec2& place, const View* seen = nullptr);
  // Whether that place (to begin with, the middle) is kept in focus from now on.
  void follow(bool follows);
  // The distance that was found since, once.
  std::optional<double> take_found();
  void set_unlocked(bool unlocked);
  void clear();

 private:
  // Looks for the focus at the place by sweeps.
  struct Search {
    std::optional<double> found;    // distance found by the first stage; nothing: not yet
    std::optional<uint32_t> asked;  // number of the request that carries the sweep under way
    int lost = 0;                   // requests of the search that nothing came of
  };
  void see_sweep(const FoundFocus& news);
  void take_trials(FocusControl::Plan& plan);
  void find(double distance);
  Vec2 pixel_of(const View& view) const;

  std::mutex mutex_;
  std::condition_variable changed_;
  std::optional<FoundFocus> news_;         // the latest news, but for their trials
  std::deque<std::vector<Trial>> unsent_;  // trials not sent yet, for one request each, of the map of the news
  Vec2 place_{0.5, 0.5};
  bool follows_ = false;
  std::optional<Search> search_;
  std::deque<uint32_t> swept_;  // the latest sweeps, the newest last: what comes of them is no surface
  uint32_t requests_ = 0;       // requests since the latest sweep
  std::optional<double> found_;
  std::optional<double> latest_;  // the distance last found at place_
  double now_ = 0;                // focus distance of the latest request
  bool unlocked_ = false;
};

// Focal surfaces of views whose viewers can't be told of them: requests get them as they pass. Thread-safe.
class RelayedFocus {
 public:
  void announce(uint32_t view_id, FoundFocus focus);
  // Gives the request the surface and the trials of its view, if it has no surface of its own, and returns whether it
  // did.
  bool apply(ViewRequest& request);
  void clear();

 private:
  static constexpr size_t kMostViews = 64;  // with more views the lowest id is forgotten
  FocusFeedback& view(uint32_t id);
  std::mutex mutex_;
  std::map<uint32_t, FocusFeedback> views_;
};

}  // namespace lf
