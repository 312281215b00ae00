// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <chrono>
#include <condition_variable>
#include <deque>
#include <map>
#include <mutex>
#include <optional>

#include "focus/view_depths.h"
#include "rig/rig.h"
#include "view/view_request.h"

namespace lf {

// Passes the depth estimates of a view from the compositor, which sees the answers, to the source of the view's
// requests. The next request then has the latest focal surface and the next hypotheses. The class also runs autofocus
// searches. Thread-safe.
class DepthFeedback {
 public:
  // Receives a new estimate from the compositor.
  void announce(DepthEstimate news);
  // Waits for an estimate that is based on request `sequence` or a later request. Returns kAvailable if there is one,
  // kTimeout after `longest`, and kUnlocked if set_unlocked() ends the wait.
  enum class WaitResult { kAvailable, kTimeout, kUnlocked };
  WaitResult wait_for(uint32_t sequence, std::chrono::milliseconds longest);
  // Adds the surface, warped to the request's view, and the next hypotheses and gains to a request. Hypotheses and
  // gains are added to one request only. In a set of views, such as a stereo pair, only the request of the leading view
  // gets hypotheses and gains.
  void apply(ViewRequest& request);
  // Returns true if apply() would add hypotheses now.
  bool has_hypotheses();
  // Returns an autofocus request to send in addition to `request`, or nothing if no search needs one now. Its view is
  // the part of the request's view around the place to focus on. After the request has a sequence number, call
  // sweep_sent(). `rig` is the rig of the view, or null if it is unknown.
  std::optional<ViewRequest> next_sweep(const ViewRequest& request, const Rig* rig);
  void sweep_sent(uint32_t sequence);

  // Sets the place to focus on, in fractions of the view's width and height, for example (0.5, 0.5) for the middle.
  // Returns the focus distance if there is a surface. Otherwise returns nothing, and the next requests start an
  // autofocus search. `seen` is the view of a set where the viewer has pointed at the place; all views of a set have
  // the same direction. If it is null, the place is in the view of the latest surface.
  std::optional<double> focus_at(const Vec2& place, const View* seen = nullptr);
  // Starts or ends continuous autofocus, which repeats the search at the place of focus_at(). The place is initially
  // the middle of the view.
  void follow(bool follows);
  // Returns the focus distance that a search has found. Each result is returned only once.
  std::optional<double> take_found();
  // If true, wait_for() returns kUnlocked at once, for example while the application stops.
  void set_unlocked(bool unlocked);
  void clear();

 private:
  struct Search {
    std::optional<double> found;    // distance found by the first stage; nothing: not yet
    std::optional<uint32_t> sequence;  // number of the sweep request in flight
    int lost = 0;                   // lost requests of the search
  };
  void see_sweep(const DepthEstimate& news);
  void take_hypotheses(DepthEstimator::Plan& plan);
  void find(double distance);
  Vec2 pixel_of(const View& view) const;

  std::mutex mutex_;
  std::condition_variable changed_;
  std::optional<DepthEstimate> latest_estimate_;  // latest estimate, without its hypotheses
  std::deque<std::vector<DepthHypothesis>>
      unsent_;  // hypotheses for the map of latest_estimate_, one entry per request
  Vec2 place_{0.5, 0.5};
  bool follows_ = false;
  std::optional<Search> search_;
  std::deque<uint32_t>
      sweep_sequences_;         // numbers of the latest sweeps, newest last; their results are no surfaces of the view
  uint32_t requests_ = 0;       // requests since the latest sweep
  std::optional<double> found_;
  std::optional<double> latest_;  // last distance found at place_
  double now_ = 0;                // focus distance of the latest request
  bool unlocked_ = false;
};

// Keeps the latest depth estimates of several views, for viewers that cannot receive feedback. Their requests pass
// through this object, which adds the surface and the hypotheses. Thread-safe.
class RelayedDepths {
 public:
  void announce(uint32_t view_id, DepthEstimate focus);
  // Adds the surface and the hypotheses of its view to a request without a surface. Returns true if it changed the
  // request.
  bool apply(ViewRequest& request);
  void clear();

 private:
  static constexpr size_t kMaxViews = 64;  // if there are more views, the view with the lowest id is dropped
  DepthFeedback& view(uint32_t id);
  std::mutex mutex_;
  std::map<uint32_t, DepthFeedback> views_;
};

}  // namespace lf
