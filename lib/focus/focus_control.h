// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <limits>
#include <optional>
#include <span>
#include <vector>

#include "focus/depth_range.h"
#include "focus/latest_surface.h"
#include "focus/moments.h"
#include "focus/surface_choice.h"
#include "view/view_request.h"

namespace lf {

// How a view is focused.
enum class FocusMode {
  kPlane,    // on the viewer's plane
  kSurface,  // on a surface that trials improve with every request
  kAuto,     // the same, with as many trials as the scene needs
};

// Decides, picture after picture of one view, on which surface the next one is focused and what is tried for it. A plain
// value without locks.
class FocusControl {
 public:
  struct Settings {
    FocusMode mode = FocusMode::kPlane;
    // Metres from the array. 0: at first kNearest and kFarthest times the viewer's focus distance, then as the scene asks.
    double near = 0, far = 0;
    bool operator==(const Settings&) const = default;
  };
  static constexpr double kNearest = 0.4, kFarthest = 4;
  // A rest begins when kQuietRounds did not get better by this; then fewer and fewer requests have trials. It ends when a
  // round gains that much more than kMoreAtRest times what it did before the rest.
  static constexpr unsigned kQuietRounds = 6;
  static constexpr double kMoreAtRest = 1.25;
  static constexpr double kWorthwhile = 0.1;       // levels of luma
  static constexpr double kWorthwhilePart = 0.05;  // of the residual: noise always seems to gain something
  static constexpr unsigned kLongestRest = 8, kLongestFlatRest = 16;  // requests from one with trials to the next
  // How much farther the cameras may disagree through one plane than through the surface for the plane to be enough.
  static constexpr double kFlatEnough = 0.05;  // levels of luma
  // The scene is another one when the cameras disagree by this factor and so many levels of luma more than they used to:
  // all planes are tried again, in twice the range if that may be, and again up to kMostLooks times.
  static constexpr double kOtherFactor = 1.5, kOtherMore = 0.5;
  static constexpr unsigned kMostLooks = 3;

  FocusControl() = default;
  explicit FocusControl(const Settings& settings) : settings_(settings) {}

  // What the next request shall have: the view of `request` with another map, or none, and trials. `moments`: what came
  // of its trials, in their order and of the map's size; empty where nothing came. `from`: see FocalMap. Requests are
  // answered in the order in which they left, any number of them later: see LatestSurface.
  struct Plan {
    View view;
    std::vector<Trial> trials;
  };
  Plan next(const ViewRequest& request, std::span<const Moments> moments, const Plane& from);

  // What it came to, for statistics.
  struct State {
    unsigned rounds = 0;   // trials whose moments came
    double residual = 0;   // see SurfaceChoice, of the last of them
    double gained = 0;
    unsigned interval = 1;  // requests from one with trials to the next
    unsigned trials = 0;    // of the next request that has any
    bool flat = false;      // one plane is enough
    double deviation = 0;   // how far cameras disagree through the surface, levels of luma, mean over the nodes
    double bought = 0;      // by how much that is less than through the best plane tried lately
    double near = 0, far = 0;  // what is looked at, metres from the array; far may be infinite
    unsigned looks = 0;     // how often the scene was another one
  };
  const State& state() const { return state_; }

 private:
  std::shared_ptr<const FocalMap> first_map(const View& view, const Plane& from) const;
  bool is_automatic() const { return !(settings_.near > 0) || !(settings_.far > 0); }
  void judge(const SurfaceChoice& choice, const ViewRequest& request, FocalMap& map);
  bool is_worthwhile(const SurfaceChoice& choice, double enough);
  bool is_another_scene();
  void follow_range(bool another, FocalMap& map);
  void count_planes(const SurfaceChoice& choice, const std::vector<Trial>& trials);
  std::vector<Trial> next_trials(const FocalMap& map);

  Settings settings_;
  State state_;
  LatestSurface latest_;
  double flat_inverse_ = 0;  // where one plane is enough, 1/m
  std::optional<DepthRange> range_;  // of all maps, where it follows the scene
  std::vector<double> plane_deviations_;  // of the best plane of each of the latest rounds
  double gained_before_ = 0, usual_gain_ = 0;  // see is_worthwhile()
  double least_reached_ = std::numeric_limits<double>::infinity();
  double usual_ = 0;       // deviation that there used to be; 0: not known yet
  unsigned round_ = 0;     // of trials_of_round()
  unsigned quiet_ = 0;     // rounds in a row that were not worth while
  unsigned skipped_ = 0;   // requests since the last trials
  unsigned settling_ = 0;  // rounds until deviations tell something again
  unsigned looks_ = 0;     // in a row that did not help
};

}  // namespace lf
