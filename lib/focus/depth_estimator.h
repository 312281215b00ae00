// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <deque>
#include <limits>
#include <optional>
#include <span>
#include <vector>

#include "focus/depth_ambiguity.h"
#include "focus/depth_selection.h"
#include "focus/focus_array.h"
#include "focus/photo_consistency.h"
#include "focus/warp_depth_map.h"
#include "view/view_request.h"

namespace lf {

enum class FocusMode {
  kPlane,    // on the viewer's plane
  kSurface,  // on a surface that depth hypotheses refine with every request
  kAuto,     // on such a surface, with as many hypotheses as the scene needs
};

// Selects the focal surface and the depth hypotheses of the next request, picture after picture of one view. A plain
// value without locks.
//
// The viewer's plane is shown until the cameras agree clearly better through the surface, and again as soon as they do
// not: no picture is knowingly worse than the plane's.
class DepthEstimator {
 public:
  struct Settings {
    FocusMode mode = FocusMode::kPlane;
    // Nearest and farthest depth that the estimator searches, metres from the array. If a limit is 0, it is automatic:
    // the first search covers all depths that the array can distinguish, and later searches follow the scene.
    double near = 0, far = 0;
    bool operator==(const Settings&) const = default;
  };
  // If the geometry of the array is unknown, the search begins at this fraction of the viewer's focus distance.
  static constexpr double kNearest = 0.4;
  // The surface is shown once its squared deviation is less than kShown of the plane's, and lower by kWorthShowing. It
  // is hidden above kHidden of the plane's.
  static constexpr double kShown = 0.5, kHidden = 0.65;
  // The same as kShown for a view that lies beside the camera mesh as a whole. A wrong depth displaces objects there,
  // so the surface must be better.
  static constexpr double kShownBeside = 0.4;
  static constexpr double kWorthShowing = 4;  // levels of luma, squared
  // Factor from light lost by the surface to squared deviation, relative to the light that blur may have moved. The
  // factor is at most 1 / kSmallestLost: the smallest relevant object covers kSmallestLost of a quarter of the picture,
  // and its squared error is its lost light divided by this fraction.
  static constexpr double kMovedLight = 5;
  static constexpr double kSmallestLost = 0.01;
  // The surface is not shown if its squared error exceeds this part of the plane's when an equally plausible depth is
  // the true one.
  static constexpr double kDoubtful = 0.7;
  // After kQuietRounds rounds without improvement the estimator rests: fewer and fewer requests have hypotheses. The
  // rest ends when a round gains more than kMoreAtRest times the gain before the rest, plus the smallest worthwhile
  // gain.
  static constexpr unsigned kQuietRounds = 6;
  static constexpr double kMoreAtRest = 1.25;
  static constexpr double kWorthwhile = 0.1;  // smallest worthwhile gain, levels of luma
  // Smallest worthwhile gain as a part of the residual.
  static constexpr double kWorthwhilePart = 0.05;
  static constexpr unsigned kLongestRest = 8, kLongestFlatRest = 16;  // requests from one with hypotheses to the next
  // Largest excess of the deviation through one plane over that through the surface for the plane to suffice.
  static constexpr double kFlatEnough = 0.05;  // levels of luma
  // The scene has changed when the deviation exceeds kOtherFactor times the usual deviation plus kOtherMore levels of
  // luma. All depths are then searched again, up to kMostLooks times.
  static constexpr double kOtherFactor = 1.5, kOtherMore = 0.5;
  static constexpr unsigned kMostLooks = 3;

  DepthEstimator() = default;
  explicit DepthEstimator(const Settings& settings) : settings_(settings) {}

  // The next request: the view of `request` with another map, or none, and hypotheses. `moments`: sums for the
  // hypotheses of `request`, in their order and of the map's size; empty if there are none. Requests are answered in
  // the order in which they were sent, and any number can be in flight: see LatestSurface.
  struct Plan {
    View view;
    std::vector<DepthHypothesis> hypotheses;
    bool on_plane = false;       // see ViewRequest
    std::optional<Plane> plane;  // plane to show instead of the viewer's, if one plane suffices
  };
  Plan next(const ViewRequest& request, std::span<const PhotoConsistency> moments, const FocusArray& array);

  // Reports whether a picture was complete in time. Incomplete pictures reduce the requests with hypotheses, down to
  // one in kMinHypotheses.
  void keep_up(bool complete);
  static constexpr unsigned kMinHypotheses = 4;
  // Saves time: from now on at most one in `requests` requests, 1 or more, has hypotheses.
  void spare(unsigned requests) { spared_ = requests; }

  struct State {
    unsigned rounds = 0;  // answered rounds of hypotheses
    double residual = 0;  // DepthSelection::residual of the latest round
    double gained = 0;
    unsigned interval = 1;     // requests from one with hypotheses to the next
    unsigned hypotheses = 0;   // hypotheses of the next request that has any
    bool flat = false;         // one plane suffices
    bool mixed = false;        // several cameras contribute to the picture, so their brightness should match
    bool on_plane = true;      // the viewer's plane, or the sufficient one, is shown
    double deviation = 0;      // mean deviation of the cameras through the surface, levels of luma
    double bought = 0;         // deviation through the best recently tried plane, minus `deviation`
    double near = 0, far = 0;  // depth range of the map, metres from the array; far may be infinite
    unsigned looks = 0;        // number of scene changes
  };
  const State& state() const { return state_; }

 private:
  // kSearch: finds the scene among all depths. kSweep: finds the surface among the scene's depths. kBetter: refines the
  // surface. kNothing: pauses, because no depths can be distinguished.
  enum class Stage { kSearch, kSweep, kBetter, kNothing };

  void begin(const ViewRequest& request, const FocusArray& array, View& view);
  double reach_from(const View& view, const FocusArray& array) const;
  void search(const FocalMap& map);
  void search_around(FocalMap& map);
  void end_search(const View& view, const FocusArray& array, FocalMap& map);
  void give_up();
  void ask_again(const std::vector<DepthHypothesis>& lost);
  void sweep(const FocalMap& map);
  void take(const ViewRequest& request, std::span<const PhotoConsistency> moments, const FocusArray& array,
            FocalMap& map);
  void compare_with_plane(const DepthSelection& choice, std::span<const PhotoConsistency> moments,
                          const ViewRequest& request, const FocusArray& array);
  static double moved_by_blur(const View& view, double width);
  void remember_planes(const ViewRequest& request, std::span<const PhotoConsistency> moments);
  void doubt(const ViewRequest& request, const DepthSelection& choice, std::span<const PhotoConsistency> moments,
             size_t plane);
  void judge(const DepthSelection& choice, const ViewRequest& request, FocalMap& map);
  bool is_worthwhile(const DepthSelection& choice, double enough);
  bool is_another_scene();
  void follow_range(FocalMap& map);
  void use_range(DepthRange range, FocalMap& map);
  void count_planes(const DepthSelection& choice, const std::vector<DepthHypothesis>& hypotheses);
  LevelRange scene_levels(const FocalMap& map) const;
  std::vector<DepthHypothesis> next_hypotheses(const FocalMap& map);
  bool is_automatic() const { return !(settings_.near > 0) || !(settings_.far > 0); }

  // Requests from a search without a result to the next one: with a moving viewpoint, and the maximum with a resting
  // one.
  static constexpr unsigned kMovingBackoff = 16, kMaxBackoff = 256;
  static constexpr unsigned kBusyBackoff = 64;  // maximum if parts of the search were not answered
  static constexpr unsigned kMostLost = 8;      // maximum number of repeated requests in a search or sweep
  static constexpr unsigned kSettling = 8;      // refinement rounds until a new surface has settled

  Settings settings_;
  State state_;
  LatestSurface latest_;
  bool begun_ = false;
  double most_reach_ = 0;  // largest inverse distance that the array can resolve, 1/m
  double reach_ = 0;       // largest inverse distance to search from the current viewpoint, 1/m
  double disparity_ = 0;   // pixels per 1/m; 0: unknown
  Stage stage_ = Stage::kBetter;
  // unsent hypotheses of the stage, one entry per request
  std::deque<std::vector<DepthHypothesis>> sweeps_;
  Pose tried_from_;     // reference pose for movements of the viewpoint
  Pose tried_with_;     // pose of the last answered request with hypotheses
  bool moved_ = false;  // the viewpoint has moved since hypotheses were last sent
  // Requests from a search without a result to the next while the viewpoint rests. Doubles each time: the first
  // searches come too early if the cameras are not equally bright, see ExposureSchedule.
  unsigned backoff_ = 1;
  unsigned lost_ = 0;                          // repeated requests of this search or sweep
  int unanswered_ = 0;                         // unanswered requests of this search
  unsigned waited_ = 0;                        // requests since a search without a result
  unsigned rounds_to_doubt_ = 0, doubts_ = 4;  // rounds until a near object may trigger another search
  double flat_inverse_ = 0;                    // inverse distance of the sufficient plane, 1/m
  DepthVotes votes_;
  std::optional<DepthRange> range_;       // range of all maps, if it follows the scene
  std::vector<double> plane_deviations_;  // deviation through the best plane in each of the latest rounds
  DepthAmbiguity others_;
  // Nodes on which the surface is compared with planes, see DepthSelectionParams::counted: the nodes inside the mesh,
  // so that a part of the view beside the mesh cannot hide a good surface.
  std::vector<uint8_t> counted_;
  double doubt_ = 0;         // squared deviation that other depths add to the surface's, as a part of the plane's
  bool was_better_ = false;  // the surface was better in the last comparison with the plane
  double rested_ = 0;        // deviation before the rest
  double gained_before_ = 0, usual_gain_ = 0;  // see is_worthwhile()
  double least_reached_ = std::numeric_limits<double>::infinity();
  double usual_ = 0;       // deviation of earlier rounds; 0: unknown
  unsigned round_ = 0;     // number of the round, for hypotheses_of_round()
  unsigned quiet_ = 0;     // rounds in a row without a worthwhile gain
  unsigned skipped_ = 0;   // requests since the last hypotheses
  unsigned settling_ = 0;  // rounds until deviations are meaningful again
  unsigned load_ = 1;      // interval of the requests that may have hypotheses: see keep_up()
  unsigned spared_ = 1;    // the same, set by spare()
  unsigned in_time_ = 0;   // pictures in a row that were complete in time
  unsigned held_ = 0;      // requests since the last request that was allowed to have hypotheses
  unsigned looks_ = 0;     // unsuccessful searches in a row for a changed scene
};

}  // namespace lf
