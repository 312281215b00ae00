// SPDX-License-Identifier: LGPL-2.1-or-later
#include "focus/focus_control.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <utility>

#include "base/median.h"
#include "focus/plane_map.h"

namespace lf {
namespace {

// A search, and a sweep of a place, is not helped by what was found before: patches of 36 pixels tell depths apart that
// 12 do not.
constexpr int kSearchRadius = 4;

constexpr size_t kPlanes = kMaxTrials - 2;  // of a sweep's request, beside the surface and the viewer's plane

// Planes of a search: as far apart as trials, which average over 4 x 4 pixels, can miss nothing between; for what is
// near, and so seen large, farther apart.
constexpr double kSearchStep = 2, kSearchPart = 0.13;  // pixels of disparity; of it
constexpr double kSweepStep = 1.5;                     // the same of a sweep where the scene is
constexpr unsigned kMostSweeps = 4;

// 255 levels need not tell less than this apart.
constexpr double kFinestLevel = 1. / 32;  // pixels of disparity

// What is looked at lies around the scene: so much farther and nearer, to notice what comes from there.
constexpr double kBeyond = 1.5;
constexpr double kMuchOff = 2;  // times the range that it should be

// Requests from a search that found nothing to the next: at first, at most.
constexpr unsigned kLeastPatience = 16, kMostPatience = 256;

// Mean evidence below which the viewer's plane is shown.
constexpr double kEnoughEvidence = 0.15;

// Metres between neighbouring cameras: nothing smaller is believed to be nearer than all else.
constexpr double kSmallest = 1;

constexpr unsigned kSettling = 8;    // rounds of bettering until what was found has settled
constexpr unsigned kPlaneEvery = 4;  // rounds of bettering from one that tries the viewer's plane to the next

// `least_radius`: nodes that deviations are averaged over; more where the view shows the cameras' pixels enlarged, so
// that as many of these are looked at.
SurfaceChoice choice_of(const ViewRequest& request, std::span<const Moments> moments, const FocusArray& array,
                        int least_radius) {
  std::vector<std::vector<uint8_t>> levels;
  for (const Trial& trial : request.trials) levels.push_back(trial_levels(request.view, trial));
  const FocalMap& map = *request.view.focus.map;
  const std::vector<float> evidence = array.evidence(request.view, request.out_of_service);
  constexpr double kMostRadius = 4;
  const double larger = array.focal() > 0 ? request.view.lens.fx() / array.focal() : 1;
  ChoiceTerms terms{.evidence = evidence,
                    .radius = std::max(least_radius, static_cast<int>(std::lround(std::min(larger, kMostRadius))))};
  if (array.disparity() > 0)
    terms.levels_a_pixel = FocalMap::kLevels / (array.disparity() * (map.nearest - map.farthest));
  if (request.trials.size() < kSweep)
    for (size_t t = 1; t < request.trials.size(); t++)
      if (request.trials[t].kind == Trial::Kind::kPlane || request.trials[t].kind == Trial::Kind::kFocused)
        terms.jumps |= 1u << t;
  return choose_surface(map, levels, moments, terms);
}

double mean_of(const std::vector<float>& values) {
  return std::accumulate(values.begin(), values.end(), 0.) / static_cast<double>(values.size());
}

// Planes at these levels in as many requests as they need, each with planes from all over.
std::deque<std::vector<Trial>> requests_of(const std::vector<int16_t>& levels) {
  const size_t requests = (levels.size() + kPlanes - 1) / kPlanes;
  std::deque<std::vector<Trial>> out(requests, {{Trial::Kind::kBlurred, 0}, {Trial::Kind::kFocused, 0}});
  for (size_t i = 0; i < levels.size(); i++) out[i % requests].push_back({Trial::Kind::kPlane, levels[i]});
  return out;
}

}  // namespace

void FocusControl::begin(const ViewRequest& request, const FocusArray& array, View& view) {
  FocusControl fresh(settings_);
  fresh.load_ = load_;
  *this = std::move(fresh);
  begun_ = true;
  const double focused = plane_inverse(request.view, array.from(), {0, 0, 1});
  const double distance = focused > 0 ? 1 / focused : 1;
  disparity_ = array.disparity();
  most_reach_ = array.nearest() > 0 ? array.nearest() : 1 / (kNearest * distance);
  reach_ = reach_from(request.view, array);
  DepthRange range{settings_.far > 0 ? 1 / settings_.far : 0, settings_.near > 0 ? 1 / settings_.near : reach_};
  if (!(range.nearest > range.farthest)) range.nearest = 2 * range.farthest;
  most_reach_ = std::max(most_reach_, range.nearest);
  const auto map = std::make_shared<FocalMap>(plane_map(request.view, array.from(), range.nearest, range.farthest));
  votes_ = DepthVotes(most_reach_, kSmallest * array.spacing() * request.view.lens.fx() / map->step);
  view.focus.map = map;
  settling_ = kSettling;
  if (is_automatic())
    search(*map);
  else
    sweep(*map);
}

// What is just before the eye is seen so large that cameras agree on it wherever it is.
double FocusControl::reach_from(const View& view, const FocusArray& array) const {
  constexpr double kBeforeEye = 3;  // times its distance before the array
  const double eye = array.from().signed_distance(view.pose.position);
  return eye > 0 && !(settings_.near > 0) ? std::min(most_reach_, 1 / (kBeforeEye * eye)) : most_reach_;
}

void FocusControl::search(const FocalMap& map) {
  stage_ = Stage::kSearch;
  waited_ = 0;
  votes_.clear();
  const double pixels = disparity_ > 0 ? disparity_ : kMostSweeps * kPlanes * kSearchStep / reach_;
  std::vector<int16_t> levels;
  for (double at = map.farthest * pixels; at <= map.nearest * pixels; at += std::max(kSearchStep, kSearchPart * at))
    levels.push_back(map.level_of(at / pixels));
  if (levels.size() > kMostSweeps * kPlanes) levels.resize(kMostSweeps * kPlanes);
  sweeps_ = requests_of(levels);
}

// Looks for all that is up to twice as near or as far as what is known.
void FocusControl::search_around(FocalMap& map) {
  use_range({map.farthest / 2, 2 * map.nearest}, map);
  search(map);
}

void FocusControl::sweep(const FocalMap& map) {
  stage_ = Stage::kSweep;
  waited_ = 0;
  LevelRange scene = scene_levels(map);
  const double per_level = (map.nearest - map.farthest) / FocalMap::kLevels;
  if (const std::optional<DepthRange> known = votes_.range(); known && disparity_ > 0) {
    // What lies between two planes of a search has no votes: it may lie half-way beyond the scene,
    // and what votes is not exactly there.
    const double step = std::max(kSearchStep / disparity_, kSearchPart * known->nearest) * 0.75;
    scene.first = std::min<int>(scene.first, map.level_of(known->farthest - step));
    scene.last = std::max<int>(scene.last, map.level_of(known->nearest + step));
  }
  const double pixels = disparity_ > 0 ? (scene.last - scene.first) * per_level * disparity_ : 0;
  const auto count =
      static_cast<int>(std::clamp<double>(std::ceil(pixels / kSweepStep), kPlanes, static_cast<double>(2 * kPlanes)));
  std::vector<int16_t> levels;
  for (int k = 0; k < count; k++)
    levels.push_back(static_cast<int16_t>(scene.first + (scene.last - scene.first) * k / (count - 1)));
  sweeps_ = requests_of(levels);
}

// The levels that the scene is at, and a tenth more.
LevelRange FocusControl::scene_levels(const FocalMap& map) const {
  constexpr int kLeastMore = 6;
  const std::optional<DepthRange> scene = votes_.range();
  if (!scene) return {};
  const int first = map.level_of(scene->farthest), last = map.level_of(scene->nearest);
  const int more = std::max((last - first) / 10, kLeastMore);
  return {std::max(first - more, 0), std::min(last + more, 255)};
}

void FocusControl::judge(const SurfaceChoice& choice, const ViewRequest& request, FocalMap& map) {
  const std::vector<Trial>& trials = request.trials;
  if (settings_.mode != FocusMode::kAuto) return;
  const double enough = std::max(kWorthwhile, kWorthwhilePart * choice.residual);
  const bool gains = choice.gained >= enough, worthwhile = is_worthwhile(choice, enough);
  if (gains) state_.flat = false;
  // A plane that is in use gives way only to a better one.
  double least = choice.cost[0] + (state_.flat ? 0 : kFlatEnough);
  for (size_t t = 1; t < trials.size() && !gains; t++) {
    if (trials[t].kind != Trial::Kind::kPlane || !(choice.cost[t] <= least)) continue;
    state_.flat = true;
    flat_inverse_ = request.view.focus.map->inverse_of(trials[t].value);
    least = choice.cost[t];
  }
  if (state_.flat) std::ranges::fill(map.levels, map.level_of(flat_inverse_));
  if (worthwhile) {
    quiet_ = 0;
    state_.interval = 1;
  } else if (++quiet_ >= kQuietRounds) {
    state_.interval = std::min(2 * state_.interval, state_.flat ? kLongestFlatRest : kLongestRest);
  }
}

// Where there are edges every round gains something, as what was smoothed becomes sharp again. What counts is that it
// gets better, and at rest that it gains more than it did without.
bool FocusControl::is_worthwhile(const SurfaceChoice& choice, double enough) {
  const double before = std::exchange(gained_before_, choice.gained), gained = std::max(before, choice.gained);
  if (state_.flat && choice.gained >= enough) return true;
  if (state_.interval > 1) {
    if (gained < kMoreAtRest * usual_gain_ + enough && choice.cost[0] < kMoreAtRest * rested_ + enough) return false;
    least_reached_ = std::numeric_limits<double>::infinity();
    return true;
  }
  usual_gain_ = gained;
  rested_ = choice.cost[0];
  const double reached = choice.cost[0] - choice.gained;
  const bool better = reached < least_reached_ - enough;
  if (better) least_reached_ = reached;
  return better;
}

// Whether the cameras disagree much more than they used to.
bool FocusControl::is_another_scene() {
  const double now = state_.deviation;
  if (stage_ != Stage::kBetter) return false;
  if (settling_ > 0) {
    settling_--;
    return false;
  }
  if (!(usual_ > 0)) usual_ = now;
  // What moves makes cameras disagree for a while: a surface that is still far better than any plane is about right.
  constexpr double kStillBetter = 0.2;
  if (now <= kOtherFactor * usual_ + kOtherMore || state_.bought > kStillBetter * now) {
    constexpr double kSlowly = 0.1;
    usual_ += kSlowly * (now - usual_);
    looks_ = 0;
    return false;
  }
  if (looks_ >= kMostLooks) {  // so be it
    usual_ = now;
    return false;
  }
  looks_++;
  state_.looks++;
  state_.flat = false;
  state_.interval = 1;
  quiet_ = round_ = 0;
  least_reached_ = std::numeric_limits<double>::infinity();
  settling_ = kSettling + static_cast<unsigned>(latest_.underway());
  return true;
}

void FocusControl::use_range(DepthRange range, FocalMap& map) {
  if (settings_.near > 0) range.nearest = map.nearest;
  if (settings_.far > 0) range.farthest = map.farthest;
  range.nearest = std::min(range.nearest, reach_);
  if (disparity_ > 0) {
    const double least = FocalMap::kLevels * kFinestLevel / disparity_, more = least - (range.nearest - range.farthest);
    if (more > 0) range = {std::max(range.farthest - more / 2, 0.), range.nearest + more / 2};
    constexpr double kFar = 0.5;  // pixels from infinity
    if (range.farthest * disparity_ < kFar && !(settings_.far > 0)) range.farthest = 0;
  }
  if (!(range.nearest > range.farthest) || (range == DepthRange{map.farthest, map.nearest})) return;
  range_ = range;
  set_range(range, map);
}

// Only nodes that can tell have a say.
void FocusControl::follow_range(FocalMap& map) {
  const std::optional<DepthRange> scene = votes_.range();
  if (!is_automatic() || !scene) return;
  const DepthRange right{scene->farthest / kBeyond, kBeyond * scene->nearest};
  constexpr double kAtTheEnd = 8 / FocalMap::kLevels;
  const double end = kAtTheEnd * (map.nearest - map.farthest);
  const bool at_near_end = scene->nearest > map.nearest - end && map.nearest < reach_;
  // One plane among a few is taken by chance: what seems to come nearer has to be found by a search, too.
  if (at_near_end && stage_ == Stage::kBetter) {
    if (rounds_to_doubt_ > 0) {
      rounds_to_doubt_--;
    } else {
      rounds_to_doubt_ = doubts_;
      doubts_ = std::min(2 * doubts_, kMostPatience);
      return search_around(map);
    }
  }
  const bool at_far_end = scene->farthest < map.farthest + end && map.farthest > 0;
  const bool too_wide = map.nearest - map.farthest > kMuchOff * (right.nearest - right.farthest);
  const bool too_near = map.nearest > (1 + 1e-9) * reach_;
  if (at_far_end || too_wide || too_near || stage_ == Stage::kSearch) use_range(right, map);
}

// What a surface is worth beside the planes that were tried.
void FocusControl::count_planes(const SurfaceChoice& choice, const std::vector<Trial>& trials) {
  double least = std::numeric_limits<double>::infinity();
  for (size_t t = 0; t < trials.size(); t++)
    if ((trials[t].kind == Trial::Kind::kPlane || state_.flat) && choice.cost[t] < least) least = choice.cost[t];
  plane_deviations_.push_back(least);
  if (plane_deviations_.size() > kSweepPlanes) plane_deviations_.erase(plane_deviations_.begin());
  const double best = *std::ranges::min_element(plane_deviations_);
  state_.bought = std::isfinite(best) ? best - choice.cost[0] : 0;
}

// Whether the picture through the surface can be shown: where the cameras agree better than through the viewer's plane.
void FocusControl::compare_with_plane(const SurfaceChoice& choice, const std::vector<Trial>& trials) {
  const auto plane = std::ranges::find(trials, Trial::Kind::kFocused, &Trial::kind);
  if (plane == trials.end() || stage_ == Stage::kSearch) return;
  const double of_plane = choice.energy[static_cast<size_t>(plane - trials.begin())], of_surface = choice.energy[0];
  if (!(of_plane >= 0)) return;
  if (trials.size() >= kSweep) {  // what a sweep finds is not yet measured, and looks better than it is
    constexpr double kClearly = 0.3, kWorthClearly = 20;
    if (sweeps_.empty() && choice.least_energy < kClearly * of_plane && of_plane - choice.least_energy > kWorthClearly)
      state_.on_plane = false;
    return;
  }
  if (state_.on_plane) {
    // One plane for all nodes is no matter of luck.
    const double worth = state_.flat ? 0 : kWorthShowing;
    if (of_surface < kShown * of_plane && of_plane - of_surface > worth) state_.on_plane = false;
  } else if (of_surface > kHidden * of_plane) {
    state_.on_plane = true;
  }
}

void FocusControl::keep_up(bool complete) {
  constexpr unsigned kRecovered = 30;  // pictures
  if (!complete) {
    load_ = std::min(2 * load_, kLeastTrials);
    in_time_ = 0;
  } else if (++in_time_ >= kRecovered) {
    load_ = std::max(load_ / 2, 1u);
    in_time_ = 0;
  }
}

// Nothing tells depths apart: the viewer's plane it is, until something has changed.
void FocusControl::give_up() {
  stage_ = Stage::kNothing;
  state_.on_plane = true;
  waited_ = 0;
  patience_ = std::min(2 * patience_, kMostPatience);
}

std::vector<Trial> FocusControl::next_trials(const FocalMap& map) {
  if (++held_ < load_) return {};
  held_ = 0;
  if (!sweeps_.empty()) {
    std::vector<Trial> trials = std::move(sweeps_.front());
    sweeps_.pop_front();
    state_.trials = static_cast<unsigned>(trials.size());
    return trials;
  }
  if (stage_ == Stage::kNothing) {
    if (++waited_ < (moved_ ? std::min(kLeastPatience, patience_) : patience_)) return {};
    moved_ = false;
    search(map);
    return next_trials(map);
  }
  if (stage_ == Stage::kSearch || stage_ == Stage::kSweep) {  // what comes of it decides what comes next
    const bool over = latest_.underway() == 0 || ++waited_ > LatestSurface::kMostUnderway;
    if (stage_ == Stage::kSearch || !over) return {};
    stage_ = Stage::kBetter;
  }
  constexpr unsigned kMovingFlatRest = 4;
  const unsigned moving_rest = state_.flat ? std::min(state_.interval, kMovingFlatRest) : 1;
  if (++skipped_ < (moved_ ? moving_rest : state_.interval)) return {};
  moved_ = false;
  skipped_ = 0;
  std::vector<Trial> trials;
  const unsigned round = round_++;
  if (state_.flat) {
    // There are no edges to move: planes nearby, and planes all over.
    constexpr int kNearby[] = {8, 4, 2, 1};  // levels, by turns
    trials = trials_of_round(round);
    trials.erase(trials.begin() + 1, trials.end() - 1);
    for (const int by : {-kNearby[round % 4], kNearby[round % 4]})
      trials.push_back({Trial::Kind::kPlane, static_cast<int16_t>(std::clamp(map.levels.front() + by, 0, 255))});
  } else {
    trials = trials_of_round(round, is_automatic() ? scene_levels(map) : LevelRange{});
    // Every third round asks whether a plane would do.
    if (settings_.mode == FocusMode::kAuto && round_ % 3 == 0)
      trials.back() = {Trial::Kind::kPlane, median(map.levels)};
  }
  // A plane that is all the scene needs stands where the viewer's would be tried.
  const bool is_replaced = state_.flat && !state_.on_plane;
  if (round % kPlaneEvery == 0 && !is_replaced)
    trials[state_.flat ? 1 : trials.size() - 1] = {Trial::Kind::kFocused, 0};
  state_.trials = static_cast<unsigned>(trials.size());
  return trials;
}

// What came of a request's trials.
void FocusControl::take(const ViewRequest& request, std::span<const Moments> moments, const FocusArray& array,
                        FocalMap& map) {
  SurfaceChoice choice = choice_of(request, moments, array, stage_ == Stage::kSearch ? kSearchRadius : 1);
  FocalMap chosen = map;
  chosen.levels = choice.levels;
  if (stage_ != Stage::kSearch || state_.on_plane)
    map.levels = chosen.levels;
  else  // a search is coarser than the surface that is shown
    std::ranges::fill(choice.chosen, 0);
  state_.rounds++;
  state_.residual = choice.residual;
  state_.gained = choice.gained;
  if (range_) set_range(*range_, map);
  latest_.merge(request, choice, map);
  if (choice.cost.empty() || !std::isfinite(choice.cost[0])) return;
  state_.deviation = choice.cost[0];
  votes_.add(chosen, choice);
  compare_with_plane(choice, request.trials);
  count_planes(choice, request.trials);
  if (stage_ == Stage::kSearch) return;
  judge(choice, request, map);
  if (is_another_scene()) {
    if (!is_automatic()) return sweep(map);
    search_around(map);
  } else {
    follow_range(map);
  }
}

FocusControl::Plan FocusControl::next(const ViewRequest& request, std::span<const Moments> moments,
                                      const FocusArray& array) {
  Plan plan{.view = request.view};
  const std::shared_ptr<const FocalMap>& map = request.view.focus.map;
  if (settings_.mode == FocusMode::kPlane) {
    plan.view.focus.map = nullptr;
    if (!map || moments.empty()) return plan;
    // The viewer asks where it would be in focus: see add_focus_sweep().
    auto found = std::make_shared<FocalMap>(*map);
    found->levels = choice_of(request, moments, array, kSearchRadius).levels;
    plan.view.focus.map = std::move(found);
    return plan;
  }
  if (array.is_known() && !(array.disparity() > 0)) {  // one camera looks the same through any surface
    plan.view.focus.map = nullptr;
    return plan;
  }
  const bool is_first = !begun_;
  if (is_first)
    begin(request, array, plan.view);
  else
    reach_ = reach_from(request.view, array);
  if (!is_first && map && !moments.empty()) {
    auto better = std::make_shared<FocalMap>(*map);
    take(request, moments, array, *better);
    plan.view.focus.map = std::move(better);
  } else if (std::shared_ptr<const FocalMap> latest = latest_.seen_from(request.view); latest && !is_first) {
    plan.view.focus.map = std::move(latest);
  }
  // A search is over when all of it has been answered, or will not be.
  if (stage_ == Stage::kSearch && sweeps_.empty() &&
      (latest_.underway() == 0 || waited_ > LatestSurface::kMostUnderway)) {
    auto searched = std::make_shared<FocalMap>(*plan.view.focus.map);
    const bool found = votes_.range().has_value();
    // A surface that is shown stays while another one is looked for.
    if (found) {
      follow_range(*searched);
    } else if (state_.on_plane) {
      use_range({0, reach_}, *searched);
    }
    if (state_.on_plane) *searched = plane_map(request.view, array.from(), searched->nearest, searched->farthest);
    if (found)
      sweep(*searched);
    else if (state_.on_plane)
      give_up();
    else
      stage_ = Stage::kBetter;
    plan.view.focus.map = std::move(searched);
  }
  if (const double apart = glm::length(plan.view.pose.position - tried_from_.position); apart > 0) {
    moved_ = moved_ || apart > 0.25 * array.spacing() || !(tried_from_.orientation == plan.view.pose.orientation);
    if (moved_) tried_from_ = plan.view.pose;
  }
  latest_.set(plan.view);
  const FocalMap& next = *plan.view.focus.map;
  state_.near = 1 / next.nearest;
  state_.far = 1 / next.farthest;
  plan.trials = next_trials(next);
  if (!plan.trials.empty()) latest_.leaves(plan.trials);
  // Where one camera makes nearly all of the picture every surface seems to fit, and only displaces what it sees.
  const bool little = mean_of(array.evidence(plan.view, request.out_of_service)) < kEnoughEvidence;
  plan.on_plane = state_.on_plane || state_.flat || little;
  state_.sure = !little && stage_ == Stage::kBetter && (!state_.on_plane || state_.flat);
  if (state_.flat && !state_.on_plane && !little)
    plan.plane = Plane{next.from.normal, next.from.d - 1 / next.inverse_of(next.levels.front())};
  return plan;
}

}  // namespace lf
