// SPDX-License-Identifier: LGPL-2.1-or-later
#include "focus/depth_estimator.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <utility>

#include "focus/hypothesis_levels.h"
#include "focus/photo_consistency.h"

namespace lf {
namespace {

// Averaging radius of deviations in a search or an autofocus request, in nodes. They have no earlier surface to start
// from, so they need larger patches: a patch of 36 pixels can distinguish depths that a patch of 12 pixels cannot.
constexpr int kSearchRadius = 4;
// Largest patch, as a fraction of the shorter side of a map. A larger patch would contain both near and far objects.
constexpr double kLargestPatch = 0.3;
int search_radius(const FocalMap& map) {
  const int side = std::min(map.columns, map.rows);
  return std::clamp(static_cast<int>((kLargestPatch * side - 1) / 2), 1, kSearchRadius);
}

// Minimum number of nodes to show a surface: with fewer nodes in a quarter of the picture, lost light is
// indistinguishable from chance.
constexpr size_t kFewestNodes = 150;

// A surface is only shown if the mean evidence of the nodes, without nodes of zero evidence, is at least this value.
constexpr double kEnoughEvidence = 0.15;

// Selects the depths for the answer to a request. `least_radius` is the smallest averaging radius of deviations, in
// nodes. The radius grows if the view enlarges the cameras' pixels, so that it covers as many of these pixels.
// `is_still` means that the viewpoint has not moved. A plane that fits far from the surface is then more likely a
// coincidence than right. Adds the round to `confidence`, unless it is null.
DepthSelection choice_of(const ViewRequest& request, std::span<const PhotoConsistency> moments, const FocusArray& array,
                         int least_radius, bool is_still, std::span<const uint8_t> counted,
                         DepthConfidence* confidence = nullptr) {
  const std::vector<std::vector<uint8_t>> levels = hypothesis_levels(request.view, request.hypotheses);
  const FocalMap& map = *request.view.focus.map;
  const std::vector<float> evidence = array.evidence(request.view, request.out_of_service);
  constexpr double kMaxRadius = 4;
  const double larger = array.focal() > 0 ? request.view.lens.fx() / array.focal() * FocalMap::kMinStep / map.step : 1;
  DepthSelectionParams terms{
      .evidence = evidence,
      .counted = counted,
      .radius = std::max(least_radius, static_cast<int>(std::lround(std::min(larger, kMaxRadius)))),
      .levels_a_pixel = array.levels_a_pixel(map)};
  if (is_still && request.hypotheses.size() < kSweep)
    for (size_t t = 1; t < request.hypotheses.size(); t++)
      if (request.hypotheses[t].kind == DepthHypothesis::Kind::kPlane ||
          request.hypotheses[t].kind == DepthHypothesis::Kind::kFocused)
        terms.jumps |= 1u << t;
  DepthSelection choice = select_depths(map, levels, moments, terms);
  if (confidence) confidence->add({map, levels, choice.costs, evidence, terms.levels_a_pixel});
  return choice;
}

// Returns true if a single camera contributes nearly all of the picture, so that every surface fits. Nodes without
// evidence are outside the covered part of the view and are ignored.
bool sees_little(const std::vector<float>& evidence) {
  const auto seen = static_cast<size_t>(std::ranges::count_if(evidence, [](float of_node) { return of_node > 0; }));
  const double all = std::accumulate(evidence.begin(), evidence.end(), 0.);
  return seen < kFewestNodes || all < kEnoughEvidence * static_cast<double>(seen);
}

}  // namespace

void DepthEstimator::judge(const DepthSelection& choice, const ViewRequest& request, FocalMap& map) {
  const std::vector<DepthHypothesis>& hypotheses = request.hypotheses;
  if (settings_.mode != FocusMode::kAuto) return;
  const double enough = std::max(kWorthwhile, kWorthwhilePart * choice.residual);
  const bool gains = choice.gained >= enough, worthwhile = is_worthwhile(choice, enough);
  if (gains) state_.flat = false;
  double least = choice.cost[0] + (state_.flat ? 0 : kFlatEnough);
  for (size_t t = 1; t < hypotheses.size() && !gains; t++) {
    if (hypotheses[t].kind != DepthHypothesis::Kind::kPlane || !(choice.cost[t] <= least)) continue;
    state_.flat = true;
    flat_inverse_ = request.view.focus.map->inverse_of(hypotheses[t].value);
    least = choice.cost[t];
  }
  if (state_.flat) std::ranges::fill(map.levels, map.level_of(flat_inverse_));
  if (worthwhile) {
    rounds_without_gain_ = 0;
    state_.interval = 1;
  } else if (++rounds_without_gain_ >= kQuietRounds) {
    state_.interval = std::min(2 * state_.interval, state_.flat ? kLongestFlatRest : kLongestRest);
  }
}

// Returns true if the latest round of hypotheses was worth its cost; otherwise the estimator begins to rest. The gain
// alone does not show this: depth edges gain in every round, because the smoothed surface blurs them and the round
// makes them sharp again. A round is therefore worthwhile if the deviation after the round is lower than ever, or, at
// rest, if the round gains more than before the rest.
bool DepthEstimator::is_worthwhile(const DepthSelection& choice, double enough) {
  const double before = std::exchange(gained_before_, choice.gained), gained = std::max(before, choice.gained);
  if (state_.flat && choice.gained >= enough) return true;
  if (state_.interval > 1) {
    if (gained < kMoreAtRest * usual_gain_ + enough && choice.cost[0] < kMoreAtRest * rest_deviation_ + enough)
      return false;
    least_deviation_ = std::numeric_limits<double>::infinity();
    return true;
  }
  usual_gain_ = gained;
  rest_deviation_ = choice.cost[0];
  const double reached = choice.cost[0] - choice.gained;
  const bool better = reached < least_deviation_ - enough;
  if (better) least_deviation_ = reached;
  return better;
}

// Returns true if the scene has changed, so that all depths must be searched again: the cameras disagree much more than
// usual.
bool DepthEstimator::is_another_scene() {
  const double now = state_.deviation;
  if (stage_ != Stage::kBetter) return false;
  if (settling_rounds_ > 0) {
    settling_rounds_--;
    return false;
  }
  if (!(mean_deviation_ > 0)) mean_deviation_ = now;
  // Moving objects make cameras disagree for a while. A surface that is still far better than any plane is about right
  // anyway.
  constexpr double kStillBetter = 0.2;
  if (now <= kOtherFactor * mean_deviation_ + kOtherMore || state_.over_plane > kStillBetter * now) {
    constexpr double kSlowly = 0.1;
    mean_deviation_ += kSlowly * (now - mean_deviation_);
    failed_searches_ = 0;
    return false;
  }
  if (failed_searches_ >= kMaxFailedSearches) {  // accept the new deviation
    mean_deviation_ = now;
    return false;
  }
  failed_searches_++;
  state_.scene_changes++;
  can_measure_ = true;
  state_.flat = false;
  state_.interval = 1;
  rounds_without_gain_ = round_ = 0;
  least_deviation_ = std::numeric_limits<double>::infinity();
  settling_rounds_ = kSettling + static_cast<unsigned>(latest_.underway());
  return true;
}

void DepthEstimator::count_planes(const DepthSelection& choice, const std::vector<DepthHypothesis>& hypotheses) {
  double least = std::numeric_limits<double>::infinity();
  for (size_t t = 0; t < hypotheses.size(); t++)
    if ((hypotheses[t].kind == DepthHypothesis::Kind::kPlane || state_.flat) && choice.cost[t] < least)
      least = choice.cost[t];
  plane_deviations_.push_back(least);
  if (plane_deviations_.size() > kSweepPlanes) plane_deviations_.erase(plane_deviations_.begin());
  const double best = *std::ranges::min_element(plane_deviations_);
  state_.over_plane = std::isfinite(best) ? best - choice.cost[0] : 0;
}

// Returns the fraction of the light that blur through the viewer's plane may move. It is the squared width of the blur,
// relative to the side of a quarter of the picture. The blur is computed for objects at the ends of the depth range,
// seen by cameras `width` metres apart. If `width` is 0 (unknown), returns 1.
double DepthEstimator::moved_by_blur(const View& view, double width) {
  if (!(width > 0)) return 1;
  constexpr double kLeast = 0.05;  // light moved by noise and by differences between cameras
  const FocalMap& map = *view.focus.map;
  const double plane = std::max(plane_inverse(view, map.from, {0, 0, 1}), 0.);
  const double apart = std::max(map.nearest, plane) - std::min(map.farthest, plane);
  const double blur = width * view.lens.fx() * apart;  // pixels
  const double quarter = std::sqrt(static_cast<double>(view.width) * view.height) / 2;
  const double part = std::max(blur / quarter, kLeast);
  return part * part;
}

// Stores the results of a search or a sweep in others_. Their first two hypotheses are the surface and the viewer's
// plane, and all others are planes.
void DepthEstimator::remember_planes(const ViewRequest& request, std::span<const PhotoConsistency> moments) {
  constexpr size_t kPlane = 1, kFirst = 2;
  if (request.hypotheses.size() < kSweep || request.hypotheses[kPlane].kind != DepthHypothesis::Kind::kFocused) return;
  const std::vector<std::vector<uint8_t>> levels = hypothesis_levels(request.view, request.hypotheses);
  others_.add(request.view, levels, moments, {kPlane, kFirst});
}

// Updates doubt_, the squared error of the surface that its deviation does not show, relative to the plane's squared
// error. The estimate assumes that the surface is wrong wherever another depth fits as well. It stays unchanged while
// the viewpoint is elsewhere than in the search or sweep.
void DepthEstimator::doubt(const ViewRequest& request, const DepthSelection& choice,
                           std::span<const PhotoConsistency> moments, size_t plane) {
  const bool is_sweep = request.hypotheses.size() >= kSweep;
  PhotoConsistency surface = moments[0];
  if (is_sweep)
    for (size_t i = 0; i < choice.chosen.size(); i++) {
      const PhotoConsistency& chosen = moments[choice.chosen[i]];
      surface.weight[i] = chosen.weight[i];
      surface.luma[i] = chosen.luma[i];
      surface.square[i] = chosen.square[i];
    }
  const std::vector<uint8_t> levels = is_sweep ? choice.levels : hypothesis_levels(request.view, request.hypotheses[0]);
  const DepthAmbiguity::Errors errors = others_.errors(request.view, levels, surface, moments[plane]);
  constexpr double kEnough = 0.25;  // least fraction of the nodes for an estimate
  if (!(errors.known > kEnough) || !(errors.plane > 0) || !(errors.plane_disagrees > 0)) return;
  doubt_ = std::max(errors.surface / errors.plane - errors.surface_disagrees / errors.plane_disagrees, 0.);
}

void DepthEstimator::compare_with_plane(const DepthSelection& choice, std::span<const PhotoConsistency> moments,
                                        const ViewRequest& request, const FocusArray& array) {
  const std::vector<DepthHypothesis>& hypotheses = request.hypotheses;
  const auto focused = std::ranges::find(hypotheses, DepthHypothesis::Kind::kFocused, &DepthHypothesis::kind);
  if (focused == hypotheses.end() || stage_ == Stage::kSearch) return;
  const auto plane = static_cast<size_t>(focused - hypotheses.begin());
  const double of_plane = choice.energy[plane];
  if (!(of_plane >= 0)) return;
  // The deviation of a sweep's result is the smallest of many noisy values, so it looks better than the surface is. A
  // later round measures the surface itself.
  const bool is_sweep = hypotheses.size() >= kSweep;
  const std::vector<uint8_t> surface(choice.chosen.size(), 0);
  const double disagreement = is_sweep ? choice.least_energy : choice.energy[0];
  const double width = counted_.empty() ? array.width_of(request.view, request.out_of_service) : array.edge();
  const double of_lost = std::min(kMovedLight / moved_by_blur(request.view, width), 1 / kSmallestLost);
  doubt(request, choice, moments, plane);
  const bool is_doubtful = disagreement + doubt_ * of_plane > kDoubtful * of_plane;
  const double of_surface =
      disagreement + of_lost * moved_light(moments, is_sweep ? choice.chosen : surface, plane, counted_);
  constexpr double kClearly = 0.3, kWorthClearly = 20;
  const bool is_clear = !is_doubtful && of_surface < kClearly * of_plane && of_plane - of_surface > kWorthClearly;
  if (is_sweep) {
    if (sweeps_.empty() && is_clear) state_.on_plane = false;
  } else if (state_.on_plane) {
    // Require two better rounds in a row, unless the surface is clearly better. One better round may be chance, when a
    // moving viewpoint passes objects that appear and disappear. If one plane suffices for all nodes, any improvement
    // counts, because a single plane does not fit by chance.
    const double worth = state_.flat ? 0 : kWorthShowing;
    const double shown = stage_ == Stage::kMeasured                 ? kMeasuredShown
                         : counted_.empty() && width > array.edge() ? kShownBeside
                                                                    : kShown;
    const bool is_better = !is_doubtful && of_surface < shown * of_plane && of_plane - of_surface > worth;
    if (is_better && (is_clear || was_better_)) state_.on_plane = false;
    was_better_ = is_better;
  } else if (is_doubtful || of_surface > (stage_ == Stage::kMeasured ? kMeasuredHidden : kHidden) * of_plane) {
    state_.on_plane = true;
  }
}

void DepthEstimator::adapt_interval(bool complete) {
  constexpr unsigned kRecovered = 30;  // pictures
  if (!complete) {
    load_interval_ = std::min(2 * load_interval_, kMinHypotheses);
    consecutive_on_time_ = 0;
  } else if (++consecutive_on_time_ >= kRecovered) {
    load_interval_ = std::max(load_interval_ / 2, 1u);
    consecutive_on_time_ = 0;
  }
}

void DepthEstimator::take(const ViewRequest& request, std::span<const PhotoConsistency> moments,
                          const FocusArray& array, FocalMap& map) {
  const bool is_still = request.view.pose == last_hypothesis_pose_;
  if (stage_ == Stage::kSearch) unanswered_--;
  last_hypothesis_pose_ = request.view.pose;
  counted_ = array.inside_mesh(request.view, request.out_of_service);
  if (static_cast<size_t>(std::ranges::count(counted_, 1)) < kFewestNodes) counted_.clear();
  DepthSelection choice = choice_of(request, moments, array, stage_ == Stage::kSearch ? search_radius(map) : 1,
                                    is_still, counted_, &confidence_);
  FocalMap chosen = map;
  chosen.levels = choice.levels;
  if (stage_ != Stage::kSearch || state_.on_plane)
    map.levels = chosen.levels;
  else  // a search is coarser than the displayed surface
    std::ranges::fill(choice.chosen, 0);
  state_.rounds++;
  state_.residual = choice.residual;
  state_.gained = choice.gained;
  if (range_) set_range(*range_, map);
  latest_.merge(request, choice, map);
  if (choice.cost.empty() || !std::isfinite(choice.cost[0])) return;
  state_.deviation = choice.cost[0];
  votes_.add(chosen, choice);
  remember_planes(request, moments);
  compare_with_plane(choice, moments, request, array);
  count_planes(choice, request.hypotheses);
  if (stage_ == Stage::kSearch) return;
  judge(choice, request, map);
  if (is_another_scene()) {
    if (!is_automatic()) return sweep(map);
    search_around(map);
  } else {
    follow_range(map);
  }
}

// Compares the measured surface of a request with the viewer's plane. Returns false if it has been worse for a while.
bool DepthEstimator::compare_measured(const ViewRequest& request, std::span<const PhotoConsistency> moments,
                                      const FocusArray& array) {
  counted_ = array.inside_mesh(request.view, request.out_of_service);
  const DepthSelection choice = choice_of(request, moments, array, 1, false, counted_, &confidence_);
  if (choice.cost.empty() || !(choice.cost[0] >= 0)) return true;
  state_.rounds++;
  state_.residual = choice.residual;
  state_.gained = 0;
  state_.deviation = choice.cost[0];
  state_.over_plane = choice.cost.back() - choice.cost[0];
  compare_with_plane(choice, moments, request, array);
  worse_ = state_.on_plane ? worse_ + 1 : 0;
  return worse_ < kSettling;
}

DepthEstimator::Plan DepthEstimator::next(const ViewRequest& answered, std::span<const PhotoConsistency> moments,
                                          const FocusArray& array) {
  ViewRequest request = answered;
  const PhotoConsistency* measured = nullptr;
  if (measures_depth(request.hypotheses)) {
    request.hypotheses.pop_back();
    if (moments.size() > request.hypotheses.size()) {
      measured = &moments.back();
      measured_answers_++;
      moments = moments.first(moments.size() - 1);
    }
  }
  Plan plan{.view = request.view};
  const std::shared_ptr<const FocalMap>& map = request.view.focus.map;
  if (settings_.mode == FocusMode::kPlane) {
    plan.view.focus.map = nullptr;
    if (!map || moments.empty()) return plan;
    // An autofocus request: see add_focus_sweep().
    auto found = std::make_shared<FocalMap>(*map);
    found->levels = choice_of(request, moments, array, kSearchRadius, true, {}).levels;
    plan.view.focus.map = std::move(found);
    return plan;
  }
  if (array.is_known() && !(array.disparity() > 0)) {  // a single camera sees the same through any surface
    plan.view.focus.map = nullptr;
    return plan;
  }
  const bool is_first = !begun_;
  if (is_first)
    begin(request, array, plan.view);
  else
    reach_ = reach_from(request.view, array);
  if (!is_first && map && moments.empty() && !request.hypotheses.empty()) latest_.lose(request);
  if (!is_first && map && !moments.empty()) {
    auto better = std::make_shared<FocalMap>(*map);
    const bool is_measured = measured && take_measured(*measured, request, *better);
    if (is_measured || stage_ == Stage::kMeasured || request.hypotheses.size() == 1) {
      latest_.lose(request);
      if (stage_ == Stage::kMeasured && !compare_measured(request, moments, array)) end_measured(false, *better);
      if (!is_measured)
        if (std::shared_ptr<const FocalMap> latest = latest_.seen_from(request.view)) *better = *latest;
    } else {
      take(request, moments, array, *better);
    }
    plan.view.focus.map = std::move(better);
  } else if (std::shared_ptr<const FocalMap> latest = latest_.seen_from(request.view); latest && !is_first) {
    plan.view.focus.map = std::move(latest);
  }
  for (const std::vector<DepthHypothesis>& lost : latest_.take_lost(request.sequence)) requeue(lost);
  // A search ends when all of its requests are answered or lost.
  if (stage_ == Stage::kSearch && sweeps_.empty() && latest_.underway() == 0) {
    auto searched = std::make_shared<FocalMap>(*plan.view.focus.map);
    end_search(request.view, array, *searched);
    plan.view.focus.map = std::move(searched);
  }
  if (const double apart = glm::length(plan.view.pose.position - reference_pose_.position); apart > 0) {
    moved_ = moved_ || apart > 0.25 * array.spacing() || !(reference_pose_.orientation == plan.view.pose.orientation);
    if (moved_) reference_pose_ = plan.view.pose;
  }
  if (const FocalMap& map = *plan.view.focus.map; map.measured != (stage_ == Stage::kMeasured)) {
    auto marked = std::make_shared<FocalMap>(map);
    marked->measured = stage_ == Stage::kMeasured;
    plan.view.focus.map = std::move(marked);
  }
  latest_.set(plan.view);
  const FocalMap& next = *plan.view.focus.map;
  state_.near = 1 / next.nearest;
  state_.far = 1 / next.farthest;
  plan.hypotheses = next_hypotheses(next);
  if (!plan.hypotheses.empty()) {
    std::vector<DepthHypothesis> tested = plan.hypotheses;
    if (measures_depth(tested)) tested.pop_back();
    latest_.leaves(tested, request.sequence);
  }
  // If one camera contributes nearly all of the picture, every surface seems to fit but only displaces the image.
  const bool little = sees_little(array.evidence(plan.view, request.out_of_service));
  plan.on_plane = state_.on_plane || state_.flat || little;
  state_.mixed = !little;
  // A plane at infinity has no distance.
  constexpr double kFarthestPlane = 1e-6;  // 1/m
  if (state_.flat && !state_.on_plane && !little)
    plan.plane =
        Plane{next.from.normal, next.from.d - 1 / std::max(next.inverse_of(next.levels.front()), kFarthestPlane)};
  return plan;
}

}  // namespace lf
