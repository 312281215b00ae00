// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <deque>
#include <limits>
#include <optional>
#include <span>
#include <vector>

#include "focus/depth_ambiguity.h"
#include "focus/depth_confidence.h"
#include "focus/depth_selection.h"
#include "focus/focus_array.h"
#include "focus/photo_consistency.h"
#include "focus/warp_depth_map.h"
#include "view/view_request.h"

namespace lf {

// Above this disparity, in pixels of the camera images, depth maps of the individual cameras give better pictures than
// the search with hypotheses. It is the disparity between cameras that contribute to the same pixel, over the depths of
// the scene. Measured (docs/quality.md): at 10 pixels, the search is better by 0.5 to 1.6 dB; at 25, the depth maps are
// better by 0.9 dB, and from 50 on by 3.3 to 8 dB.
inline constexpr double kWideDisparity = 20;

enum class FocusMode {
  kPlane,    // the plane that the viewer has chosen
  kSurface,  // a surface that follows the scene; depth hypotheses refine it with every request
  kAuto,     // as kSurface, with as many hypotheses as the scene needs
};

// Estimates the depth of the scene in one view, from picture to picture, so that the whole picture is in focus. The
// cameras test depth hypotheses with each request and report how well they agree about each hypothesis
// (PhotoConsistency). The estimator uses these sums to select the focal surface and the hypotheses of the next request.
//
// The estimator works in stages. A search tests planes over all depths, until it finds the range of the scene's depths.
// A sweep then tests planes over this range, to find a first surface. Then, rounds of a few hypotheses refine the
// surface. If the search finds that the cameras are far apart (see kWideDisparity), or finds no depths, the estimator
// asks the cameras for the surface that their own depth maps show, and uses that surface from then on.
//
// The viewer's focal plane is shown until the cameras agree clearly better through the surface. It is shown again as
// soon as they do not, so no picture should be worse than the picture through the plane. A plain value without locks.
class DepthEstimator {
 public:
  struct Settings {
    FocusMode mode = FocusMode::kPlane;
    // Nearest and farthest depth that the estimator searches, in metres from the array. A limit of 0 is automatic: the
    // first search covers all depths that the array can distinguish, and later searches follow the scene.
    double near = 0, far = 0;
    bool operator==(const Settings&) const = default;
  };
  // If the geometry of the array is unknown, this fraction of the viewer's focus distance is the nearest depth of the
  // search.
  static constexpr double kNearest = 0.4;
  // The deviation of a surface is the standard deviation between the cameras' luma at a node, which a wrong depth
  // increases. The surface is shown once its squared deviation is less than kShown of the plane's, and lower by at
  // least kWorthShowing. It is hidden again above kHidden of the plane's. The gap between kShown and kHidden prevents
  // flicker.
  static constexpr double kShown = 0.5, kHidden = 0.65;
  // Replaces kShown for a view that is completely beside the camera mesh. A wrong depth displaces objects there instead
  // of blurring them, so the surface must be better.
  static constexpr double kShownBeside = 0.4;
  // The same for a surface that the cameras have measured. Its edges are sharp, and their share of the picture small.
  static constexpr double kMeasuredShown = 0.9, kMeasuredHidden = 1;
  static constexpr double kWorthShowing = 4;  // levels of luma, squared
  // Factor that converts light that the surface loses (see moved_light()) to squared deviation. It is kMovedLight
  // divided by the part of the light that blur alone may have moved, but at most 1 / kSmallestLost. The limit assumes
  // that the smallest relevant object covers kSmallestLost of a quarter of the picture, so that its squared error is
  // its lost light divided by this fraction.
  static constexpr double kMovedLight = 5;
  static constexpr double kSmallestLost = 0.01;
  // A surface is doubtful where another depth is as plausible. It is only shown if its squared error, assuming that the
  // other depth is true, is below this fraction of the plane's.
  static constexpr double kDoubtful = 0.7;
  // After kQuietRounds rounds without improvement, the estimator rests to save time: fewer and fewer requests have
  // hypotheses. The rest ends with a round that gains more than kMoreAtRest times the gain before the rest, plus the
  // smallest worthwhile gain.
  static constexpr unsigned kQuietRounds = 6;
  static constexpr double kMoreAtRest = 1.25;
  static constexpr double kWorthwhile = 0.1;  // smallest worthwhile gain, levels of luma
  // Smallest worthwhile gain, as a fraction of the residual (see DepthSelection).
  static constexpr double kWorthwhilePart = 0.05;
  static constexpr unsigned kLongestRest = 8, kLongestFlatRest = 16;  // requests from one with hypotheses to the next
  // A scene is flat if a single plane is as good as the surface. The deviation through the plane may exceed the
  // deviation through the surface by this value.
  static constexpr double kFlatEnough = 0.05;  // levels of luma
  // The scene has changed if the deviation exceeds kOtherFactor times the usual deviation plus kOtherMore luma levels.
  // The estimator then searches all depths again. After kMaxFailedSearches unsuccessful searches, it accepts the new
  // deviation as usual.
  static constexpr double kOtherFactor = 1.5, kOtherMore = 0.5;
  static constexpr unsigned kMaxFailedSearches = 3;

  DepthEstimator() = default;
  explicit DepthEstimator(const Settings& settings) : settings_(settings) {}

  // The plan for the next request of the view: its focal surface (the map of `view`, or no map) and the hypotheses that
  // the cameras should test.
  struct Plan {
    View view;
    std::vector<DepthHypothesis> hypotheses;
    bool on_plane = false;       // show the plane instead of the map; see ViewRequest
    std::optional<Plane> plane;  // plane to show instead of the viewer's, if one plane suffices
  };
  // Returns the next plan, from the answer to `request`. `moments` are the sums of the request's hypotheses, in their
  // order and with the size of the map. The sums of kMeasured may be missing. It is empty if the request has no
  // hypotheses or they were not answered. Requests must be answered in the order of sending, but any number of requests
  // can be in flight; see LatestSurface.
  Plan next(const ViewRequest& request, std::span<const PhotoConsistency> moments, const FocusArray& array);

  // Adapts to slow nodes: reports whether a picture was complete in time. After incomplete pictures, fewer requests
  // have hypotheses, down to one in kMinHypotheses requests. After a series of complete pictures, the number rises
  // again.
  void adapt_interval(bool complete);
  static constexpr unsigned kMinHypotheses = 4;
  // Saves time by sending hypotheses less often: from now on with at most one in `requests` requests. `requests` is at
  // least 1.
  void set_min_interval(unsigned requests) { min_interval_ = requests; }

  struct State {
    unsigned rounds = 0;       // answered rounds of hypotheses
    double residual = 0;       // DepthSelection::residual of the latest round
    double gained = 0;         // DepthSelection::gained of the latest round
    unsigned interval = 1;     // requests from one with hypotheses to the next
    unsigned hypotheses = 0;   // hypotheses of the next request that has any
    bool flat = false;         // one plane suffices
    bool mixed = false;        // several cameras contribute to the picture, so their brightness should match
    bool on_plane = true;      // the viewer's plane, or the sufficient one, is shown
    double deviation = 0;      // mean deviation of the cameras through the surface, levels of luma
    double over_plane = 0;     // benefit of the surface: deviation through the best recent plane, minus `deviation`
    double near = 0, far = 0;  // depth range of the map, metres from the array; far may be infinite
    unsigned scene_changes = 0;  // number of scene changes
  };
  const State& state() const { return state_; }
  // Returns the confidence of the surface of the latest request with answered hypotheses, at the nodes of its map (see
  // DepthConfidence::map()). Null if there is no such request, or the viewer's plane is shown.
  std::shared_ptr<const FocalMap> confidence() const {
    return state_.on_plane && !state_.flat ? nullptr : confidence_.map();
  }

 private:
  // The stages, see above: kSearch, kSweep, and kBetter for refinement. In kNothing, the estimator pauses because no
  // depths can be distinguished. In kMeasured, the surface is the one that the cameras measure.
  enum class Stage { kSearch, kSweep, kBetter, kNothing, kMeasured };

  void begin(const ViewRequest& request, const FocusArray& array, View& view);
  double reach_from(const View& view, const FocusArray& array) const;
  void search(const FocalMap& map);
  void search_around(FocalMap& map);
  void end_search(const View& view, const FocusArray& array, FocalMap& map);
  void give_up();
  void requeue(const std::vector<DepthHypothesis>& lost);
  void sweep(const FocalMap& map);
  void take(const ViewRequest& request, std::span<const PhotoConsistency> moments, const FocusArray& array,
            FocalMap& map);
  bool take_measured(const PhotoConsistency& measured, const ViewRequest& request, FocalMap& map);
  bool compare_measured(const ViewRequest& request, std::span<const PhotoConsistency> moments, const FocusArray& array);
  void rest_if_unchanged(const ViewRequest& request, const FocalMap& map);
  void end_measured(bool requeue, FocalMap& map);
  std::vector<DepthHypothesis> with_measured(std::vector<DepthHypothesis> hypotheses);
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

  // After a search without a result, the estimator waits before it searches again. The wait is kMovingBackoff requests
  // if the viewpoint moves. Otherwise the wait doubles after each search, up to kMaxBackoff requests.
  static constexpr unsigned kMovingBackoff = 16, kMaxBackoff = 256;
  static constexpr unsigned kBusyBackoff = 64;  // maximum if parts of the search were not answered
  static constexpr unsigned kMaxLost = 8;       // maximum number of repeated requests in a search or sweep
  static constexpr unsigned kSettling = 8;      // refinement rounds until a new surface has settled
  // The cameras are asked for their surface with every kMeasuredEvery-th request, and after kOftenAsked answers less
  // often. It takes them some seconds to measure the first one, or a minute on a busy machine.
  static constexpr unsigned kMeasuredEvery = 4, kOftenAsked = 64, kMeasuredSeldom = 32;

  Settings settings_;
  State state_;
  LatestSurface latest_;
  bool begun_ = false;
  double max_inverse_distance_ = 0;  // largest inverse distance that the array can resolve, 1/m
  double reach_ = 0;       // largest inverse distance to search from the current viewpoint, 1/m
  double disparity_ = 0;   // pixels per 1/m; 0: unknown
  Stage stage_ = Stage::kBetter;
  // unsent hypotheses of the stage, one entry per request
  std::deque<std::vector<DepthHypothesis>> sweeps_;
  Pose reference_pose_;        // reference pose for movements of the viewpoint
  Pose last_hypothesis_pose_;  // pose of the last answered request with hypotheses
  bool moved_ = false;  // the viewpoint has moved since hypotheses were last sent
  // Requests from a search without a result to the next search while the viewpoint rests. The number begins small and
  // doubles each time, because the first searches may come too early: the cameras may not be equally bright yet (see
  // ExposureSchedule).
  unsigned backoff_ = 1;
  unsigned lost_ = 0;                          // repeated requests of this search or sweep
  int unanswered_ = 0;                         // unanswered requests of this search
  unsigned waited_ = 0;                        // requests since the last search without a result
  unsigned rounds_until_recheck_ = 0, recheck_interval_ = 4;  // rounds until a near object may trigger another search
  double flat_inverse_ = 0;                    // inverse distance of the sufficient plane, 1/m
  DepthVotes votes_;
  DepthConfidence confidence_;
  std::optional<DepthRange> range_;       // range of all maps, if it follows the scene
  std::vector<double> plane_deviations_;  // deviation through the best plane in each of the latest rounds
  DepthAmbiguity others_;
  // 1 for each node that counts in comparisons of the surface with planes, see DepthSelectionParams::counted. These are
  // the nodes inside the mesh, because a part of the view beside the mesh could hide a good surface. Empty: all nodes.
  std::vector<uint8_t> counted_;
  double doubt_ = 0;                           // squared error due to ambiguous depths, relative to the plane's
  bool was_better_ = false;                    // the surface was better in the last comparison with the plane
  double rest_deviation_ = 0;                  // deviation before the rest
  double gained_before_ = 0, usual_gain_ = 0;  // see is_worthwhile()
  double least_deviation_ = std::numeric_limits<double>::infinity();
  double mean_deviation_ = 0;  // deviation of earlier rounds; 0: unknown
  unsigned round_ = 0;     // number of the round, for hypotheses_of_round()
  unsigned rounds_without_gain_ = 0;  // rounds in a row without a worthwhile gain
  unsigned skipped_ = 0;   // requests since the last hypotheses
  unsigned settling_rounds_ = 0;            // rounds until deviations are meaningful again
  unsigned load_interval_ = 1;              // interval of the requests that may have hypotheses: see adapt_interval()
  unsigned min_interval_ = 1;               // the same, set by set_min_interval()
  unsigned consecutive_on_time_ = 0;        // pictures in a row that were complete in time
  unsigned requests_since_hypotheses_ = 0;  // requests since the last request that was allowed to have hypotheses
  unsigned requests_since_search_ = 0;      // those that could have asked for the measured surface
  bool wants_measured_ = false;             // the search found that the measured surface may be better
  unsigned measured_answers_ = 0;           // answers since the search to requests for the measured surface
  bool can_measure_ = true;         // false after the measured surface was not good enough for this scene
  unsigned worse_ = 0;              // rounds in a row in which the measured surface was worse than the plane
  unsigned failed_searches_ = 0;    // unsuccessful searches in a row for a changed scene
};

}  // namespace lf
