// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <span>

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
    double near = 0, far = 0;  // metres from the array; 0: kNearest and kFarthest times the viewer's focus distance
    bool operator==(const Settings&) const = default;
  };
  static constexpr double kNearest = 0.4, kFarthest = 4;
  // A rest begins when a whole sweep of planes gained less than this a round; then fewer and fewer requests have trials.
  static constexpr double kWorthwhile = 0.1;       // levels of luma
  static constexpr double kWorthwhilePart = 0.05;  // of the residual: noise always seems to gain something
  static constexpr unsigned kLongestRest = 8, kLongestFlatRest = 16;  // requests from one with trials to the next
  // How much farther the cameras may disagree through one plane than through the surface for the plane to be enough.
  static constexpr double kFlatEnough = 0.05;  // levels of luma

  FocusControl() = default;
  explicit FocusControl(const Settings& settings) : settings_(settings) {}

  // What the next request shall have: the view of `request` with another map, or none, and trials. `moments`: what came
  // of its trials, in their order and of the map's size; empty where nothing came. `from`: see FocalMap.
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
    bool flat = false;      // one plane is enough
  };
  const State& state() const { return state_; }

 private:
  std::shared_ptr<const FocalMap> first_map(const View& view, const Plane& from) const;
  void judge(const SurfaceChoice& choice, const std::vector<Trial>& trials, FocalMap& map);
  std::vector<Trial> next_trials(const FocalMap& map);

  Settings settings_;
  State state_;
  uint8_t flat_level_ = 0;  // where one plane is enough
  unsigned round_ = 0;    // of trials_of_round()
  unsigned quiet_ = 0;    // rounds in a row that were not worth while
  unsigned skipped_ = 0;  // requests since the last trials
};

}  // namespace lf
