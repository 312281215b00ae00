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

// Feedback of a compositor about the focal surface of a view, for the view's next request. Thread-safe.
class DepthFeedback {
 public:
  void announce(DepthEstimate news);
  // Waits for an estimate from request `sequence` or later.
  enum class Waited { kCame, kTooLong, kUnlocked };
  Waited wait_for(uint32_t sequence, std::chrono::milliseconds longest);
  // Adds the surface, warped to the request's view, hypotheses and gains. Hypotheses and gains are for a single
  // request, and in a set for the leading view.
  void apply(ViewRequest& request);
  // True if apply() would add hypotheses now.
  bool has_hypotheses();
  // Returns a request for an autofocus search to send beside `request`: a small view around the place. After it has a
  // sequence number, call sweep_sent(). `rig`: the rig of the view; may be null.
  std::optional<ViewRequest> next_sweep(const ViewRequest& request, const Rig* rig);
  void sweep_sent(uint32_t sequence);

  // Sets the place to focus on, as parts of the view's width and height. Returns the distance if a surface is known;
  // otherwise the next requests start a search. `seen`: the view of a set that shows the place; all views of a set have
  // the same direction. Null: the view of the latest surface.
  std::optional<double> focus_at(const Vec2& place, const View* seen = nullptr);
  // Starts or ends continuous autofocus on the place (initially the middle).
  void follow(bool follows);
  // Returns a newly found distance, once.
  std::optional<double> take_found();
  void set_unlocked(bool unlocked);
  void clear();

 private:
  struct Search {
    std::optional<double> found;    // distance found by the first stage; nothing: not yet
    std::optional<uint32_t> asked;  // number of the sweep request in flight
    int lost = 0;                   // lost requests of the search
  };
  void see_sweep(const DepthEstimate& news);
  void take_hypotheses(DepthEstimator::Plan& plan);
  void find(double distance);
  Vec2 pixel_of(const View& view) const;

  std::mutex mutex_;
  std::condition_variable changed_;
  std::optional<DepthEstimate> news_;                // latest estimate, without its hypotheses
  std::deque<std::vector<DepthHypothesis>> unsent_;  // unsent hypotheses for the map of news_, one entry per request
  Vec2 place_{0.5, 0.5};
  bool follows_ = false;
  std::optional<Search> search_;
  std::deque<uint32_t> swept_;  // numbers of the latest sweeps, newest last; their results are no surfaces of the view
  uint32_t requests_ = 0;       // requests since the latest sweep
  std::optional<double> found_;
  std::optional<double> latest_;  // last distance found at place_
  double now_ = 0;                // focus distance of the latest request
  bool unlocked_ = false;
};

// Focal surfaces of views for viewers that cannot receive feedback: their requests get them on the way. Thread-safe.
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
