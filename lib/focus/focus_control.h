// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <deque>
#include <limits>
#include <optional>
#include <span>
#include <vector>

#include "focus/carry_over.h"
#include "focus/focus_array.h"
#include "focus/moments.h"
#include "focus/other_depths.h"
#include "focus/surface_choice.h"
#include "view/view_request.h"

namespace lf {

// How a view is focused.
enum class FocusMode {
  kPlane,    // on the viewer's plane
  kSurface,  // on a surface that trials improve with every request
  kAuto,     // on such a surface, with as many trials as the scene needs
};

// Decides, picture after picture of one view, on which surface the next one is focused and what is tried for it. A
// plain value without locks.
//
// The viewer's plane is shown until the cameras agree clearly better through the surface, and again as soon as they do
// not: no picture is knowingly worse than the plane's.
class FocusControl {
 public:
  struct Settings {
    FocusMode mode = FocusMode::kPlane;
    // Metres from the array. 0: what the array can tell apart is searched, then the range follows the scene.
    double near = 0, far = 0;
    bool operator==(const Settings&) const = default;
  };
  // Where the array is not known, nothing nearer than this part of the viewer's focus distance is looked for.
  static constexpr double kNearest = 0.4;
  // The surface is shown once its squared deviation is less than kShown of the plane's, and by kWorthShowing less; not
  // any more when it is more than kHidden of it.
  static constexpr double kShown = 0.5, kHidden = 0.65;
  static constexpr double kWorthShowing = 4;  // levels of luma, squared
  // Light that the surface has lost counts as so much squared deviation, beside what blur may have moved: ordinary
  // surfaces lose up to 0.06 of the plane's, ones that hide a thing 0.09 and more. And never as more than if a thing of
  // this part of a quarter of the picture had gone: its squared error is what it lost over its part.
  static constexpr double kMovedLight = 5;
  static constexpr double kSmallestLost = 0.01;
  // The surface is not shown either where it would have more of the plane's squared error than this if another depth,
  // as plausible, were the truth.
  static constexpr double kDoubtful = 0.7;
  // A rest begins when kQuietRounds did not get better by this; then fewer and fewer requests have trials. It ends when
  // a round gains that much more than kMoreAtRest times what it did before the rest.
  static constexpr unsigned kQuietRounds = 6;
  static constexpr double kMoreAtRest = 1.25;
  static constexpr double kWorthwhile = 0.1;  // levels of luma
  // The part of the residual that a gain must have: noise always seems to gain something.
  static constexpr double kWorthwhilePart = 0.05;
  static constexpr unsigned kLongestRest = 8, kLongestFlatRest = 16;  // requests from one with trials to the next
  // How much farther the cameras may disagree through one plane than through the surface for the plane to be enough.
  static constexpr double kFlatEnough = 0.05;  // levels of luma
  // The scene is another one when the cameras disagree by this factor and so many levels of luma more than they used
  // to: all depths are searched again, up to kMostLooks times.
  static constexpr double kOtherFactor = 1.5, kOtherMore = 0.5;
  static constexpr unsigned kMostLooks = 3;

  FocusControl() = default;
  explicit FocusControl(const Settings& settings) : settings_(settings) {}

  // What the next request shall have: the view of `request` with another map, or none, and trials. `moments`: what came
  // of its trials, in their order and of the map's size; empty where nothing came. Requests are answered in the order
  // in which they left, any number of them later: see LatestSurface.
  struct Plan {
    View view;
    std::vector<Trial> trials;
    bool on_plane = false;       // see ViewRequest
    std::optional<Plane> plane;  // a plane to show in place of the viewer's, where a plane is all that the scene needs
  };
  Plan next(const ViewRequest& request, std::span<const Moments> moments, const FocusArray& array);

  // Whether a picture was complete in time. Where they are not there are fewer requests with trials: down to one in
  // kLeastTrials, and slowly more again.
  void keep_up(bool complete);
  static constexpr unsigned kLeastTrials = 4;
  // Spares time: at most one request in `requests`, 1 or more, has trials from now on.
  void spare(unsigned requests) { spared_ = requests; }

  // What the control has come to, for statistics.
  struct State {
    unsigned rounds = 0;  // rounds of trials whose moments came
    double residual = 0;  // SurfaceChoice::residual of the latest round
    double gained = 0;
    unsigned interval = 1;     // requests from one with trials to the next
    unsigned trials = 0;       // trials of the next request that has any
    bool flat = false;         // one plane is enough
    bool mixed = false;        // several cameras make the picture: their brightness should match
    bool on_plane = true;      // a plane is shown, the viewer's or the one that is enough
    double deviation = 0;      // how far cameras disagree through the surface, levels of luma, mean over the nodes
    double bought = 0;         // by how much `deviation` is less than through the best plane tried lately
    double near = 0, far = 0;  // what is looked at, metres from the array; far may be infinite
    unsigned looks = 0;        // how often the scene was another one
  };
  const State& state() const { return state_; }

 private:
  // What trials look for: the scene at all depths; the surface where the scene is; a better surface around the one
  // found; nothing, as no depths can be told apart.
  enum class Stage { kSearch, kSweep, kBetter, kNothing };

  void begin(const ViewRequest& request, const FocusArray& array, View& view);
  double reach_from(const View& view, const FocusArray& array) const;
  void search(const FocalMap& map);
  void search_around(FocalMap& map);
  void end_search(const View& view, const FocusArray& array, FocalMap& map);
  void give_up();
  void ask_again(const std::vector<Trial>& lost);
  void sweep(const FocalMap& map);
  void take(const ViewRequest& request, std::span<const Moments> moments, const FocusArray& array, FocalMap& map);
  void compare_with_plane(const SurfaceChoice& choice, std::span<const Moments> moments, const ViewRequest& request,
                          const FocusArray& array);
  static double moved_by_blur(const View& view, double width);
  void remember_planes(const ViewRequest& request, std::span<const Moments> moments);
  void doubt(const ViewRequest& request, const SurfaceChoice& choice, std::span<const Moments> moments, size_t plane);
  void judge(const SurfaceChoice& choice, const ViewRequest& request, FocalMap& map);
  bool is_worthwhile(const SurfaceChoice& choice, double enough);
  bool is_another_scene();
  void follow_range(FocalMap& map);
  void use_range(DepthRange range, FocalMap& map);
  void count_planes(const SurfaceChoice& choice, const std::vector<Trial>& trials);
  LevelRange scene_levels(const FocalMap& map) const;
  std::vector<Trial> next_trials(const FocalMap& map);
  bool is_automatic() const { return !(settings_.near > 0) || !(settings_.far > 0); }

  // Requests from a search that found nothing to the next: where the eye moves, and at most where it does not.
  static constexpr unsigned kMovingPatience = 16, kMostPatience = 256;
  static constexpr unsigned kBusyPatience = 64;  // at most, where not all of the search was answered
  static constexpr unsigned kMostLost = 8;       // requests of a search or a sweep that are sent again
  static constexpr unsigned kSettling = 8;       // rounds of bettering until what was found has settled

  Settings settings_;
  State state_;
  LatestSurface latest_;
  bool begun_ = false;
  double most_reach_ = 0;  // largest inverse distance that the array can tell, 1/m
  double reach_ = 0;       // largest inverse distance that is looked for from where the eye is, 1/m
  double disparity_ = 0;   // pixels for each 1/m, 0: not known
  Stage stage_ = Stage::kBetter;
  std::deque<std::vector<Trial>> sweeps_;  // trials that the stage has still to send, for one request each
  Pose tried_from_;                        // the pose that movements of the eye are counted from
  Pose tried_with_;                        // the pose of the request whose trials were answered last
  bool moved_ = false;                     // the eye has moved since trials were last sent
  // Requests from a search that finds nothing to the next of an eye that rests, twice as many each time: the first few
  // are too early where cameras are not equally bright, see MeanTurns.
  unsigned patience_ = 1;
  unsigned lost_ = 0;                          // requests of this search or sweep that were sent again
  int unanswered_ = 0;                         // requests of this search that nothing has come of
  unsigned waited_ = 0;                        // requests since a search found nothing
  unsigned rounds_to_doubt_ = 0, doubts_ = 4;  // until the range may be searched anew as something seems to come near
  double flat_inverse_ = 0;                    // inverse distance of the plane that is enough, 1/m
  DepthVotes votes_;
  std::optional<DepthRange> range_;       // range of all maps, where it follows the scene
  std::vector<double> plane_deviations_;  // deviation through the best plane of each of the latest rounds
  OtherDepths others_;
  double doubt_ = 0;         // what other depths add to the surface's squared deviation, of the plane's
  bool was_better_ = false;  // the surface was better when the plane was measured last
  double rested_ = 0;        // deviation before the rest
  double gained_before_ = 0, usual_gain_ = 0;  // see is_worthwhile()
  double least_reached_ = std::numeric_limits<double>::infinity();
  double usual_ = 0;       // deviation of earlier rounds; 0: not known yet
  unsigned round_ = 0;     // number of the round, for trials_of_round()
  unsigned quiet_ = 0;     // rounds in a row that were not worth while
  unsigned skipped_ = 0;   // requests since the last trials
  unsigned settling_ = 0;  // rounds until deviations tell something again
  unsigned load_ = 1;      // requests for one that may have trials: see keep_up()
  unsigned spared_ = 1;    // requests for one that may have trials, as told: see spare()
  unsigned in_time_ = 0;   // pictures in a row that were complete in time
  unsigned held_ = 0;      // requests since one that might have had trials
  unsigned looks_ = 0;     // searches of another scene in a row that did not help
};

}  // namespace lf
