// SPDX-License-Identifier: LGPL-2.1-or-later
#include "calibration/solve.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <numeric>
#include <random>

#include "base/text.h"
#include "calibration/initial_layout.h"
#include "calibration/multiview_geometry.h"
#include "calibration/noise.h"
#include "calibration/placement.h"
#include "calibration/reconstruction.h"

namespace lf {
namespace {

constexpr double kMinSigma = 1e-3;  // pixels; below any real noise, avoids division by zero with exact data
constexpr double kRobust = 2;       // scale of the Cauchy loss, sigmas
constexpr double kSettled = 0.05;   // change of sigma
constexpr double kFits = 4;         // pixels; residual scale of a correct first layout
constexpr double kGoodFit = 0.5;
constexpr double kCoarse = 8;  // pixels; tolerance of a first layout
constexpr size_t kMaxInitialObservations = 4000;
constexpr size_t kMinPositions = 50;
constexpr size_t kMaxInitialCorners = 20000, kMinCorners = 12;

struct PairLayout {
  const char* name;
  int (*place)(Reconstruction& scene, const Tracks& tracks, double threshold);
};
constexpr PairLayout kPairLayouts[] = {{"averaged pairs", global_layout}, {"a pair", incremental_layout}};

// Keeps every nth position: enough for poses and for the selection of a lens model.
// Boards have many corners, so each position keeps some of its corners.
Tracks subsample_tracks(Tracks tracks, size_t enough = kMaxInitialObservations) {
  if (!tracks.board.empty()) {
    const size_t n = std::min(tracks.observations.size() / (kMaxInitialCorners), tracks.board.size() / kMinCorners);
    if (n > 1)
      std::erase_if(tracks.observations, [&](const Observation& o) { return (o.light + o.position) % n != 0; });
    return tracks;
  }
  const size_t n = std::min(tracks.observations.size() / enough, tracks.num_positions / kMinPositions);
  if (n > 1) std::erase_if(tracks.observations, [&](const Observation& o) { return o.position % n != 0; });
  return tracks;
}

double sigma_of(const Reconstruction& scene, const Tracks& tracks) {
  return std::max(kMinSigma, robust_sigma(residual_lengths(scene, tracks.observations)));
}

// Adjusts to all observations under a robust loss, with the current sigma in each round. `rounds` are the maximum
// numbers of iterations. The function stops early if sigma has settled.
void adjust_robustly(Reconstruction& scene, const Tracks& tracks, AdjustmentOptions options, double tolerance,
                     const std::vector<int>& rounds) {
  options.robust = kRobust, options.tolerance = tolerance;
  for (size_t round = 0; round < rounds.size(); round++) {
    const double sigma = sigma_of(scene, tracks);
    if (round > 0 && std::abs(sigma / options.sigma - 1) < kSettled) break;
    options.sigma = sigma, options.max_iterations = rounds[round];
    adjust(scene, tracks.observations, Inliers(tracks.observations.size(), true), options);
  }
}

class RigSolver {
 public:
  RigSolver(const Tracks& tracks, const SolveOptions& options)
      : tracks_(tracks), options_(options), sample_(subsample_tracks(tracks)) {
    solution_.scene = make_scene(tracks, options);
  }

  Solution run(std::optional<Reconstruction> layout) {
    if (layout) {
      scene() = std::move(*layout);
      robust(sample_, {}, 3, 8);
    } else {
      find_layout();
      complete();
    }
    step("lenses");
    free_lenses();
    step("final adjustment");
    if (tracks_.ordered) {
      finish();
      if (weigh_cameras()) finish();
    } else {
      weigh_tracks();
    }
    use_known_poses();
    step("uncertainty");
    judge();
    if (!tracks_.ordered) compare_halves();
    if (tracks_.board.empty())
      retriangulate_weak_targets(scene(), tracks_, solution_.model.sigma, solution_.sigma, solution_.inliers);
    return std::move(solution_);
  }

 private:
  Reconstruction& scene() { return solution_.scene; }
  void step(const std::string& what) {
    if (options_.progress) options_.progress(what);
  }

  double fit() {
    double sum = 0;
    for (const double l : residual_lengths(scene(), sample_.observations))
      if (l >= 0) sum += std::max(0.0, 1 - l * l / (kFits * kFits));
    return sum / static_cast<double>(sample_.observations.size());
  }

  void find_layout() {
    const Reconstruction empty = scene();
    Reconstruction best;
    double best_fit = 0;
    const auto attempt = [&](const std::string& name, const auto& layout, bool free_f) {
      if (best_fit > kGoodFit) return;
      step("first layout: " + name);
      scene() = empty;
      if (!layout()) return;
      robust(sample_, {}, 2);
      if (free_f) robust_shared_f(sample_, 2);
      const double now = fit();
      if (now <= best_fit) return;
      best_fit = now, best = scene(), solution_.start = name;
    };
    attempt(
        "disparities", [&] { return layout_from_disparities(scene(), tracks_) > 0 && count_used() >= 2; }, false);
    if (has_layout())
      attempt(
          "the prior rig's layout", [&] { return nominal_layout(); }, false);
    for (const double f : {1.0, 0.7, 1.4, 2.0, 0.5}) {
      if (options_.prior && f != 1.0) break;
      for (const auto& [name, place] : kPairLayouts)
        attempt(
            name,
            [&, place = place] {
              if (!options_.prior)
                for (CameraState& camera : scene().cameras)
                  camera.lens_terms()[kF] = f * std::max(camera.width, camera.height);
              return place(scene(), tracks_, kCoarse) >= 2;
            },
            !options_.prior);
    }
    if (best_fit == 0)
      throw Error(
          "no two cameras see the light consistently; check that the recordings show the same moment and that no "
          "camera names are swapped");
    scene() = std::move(best);
  }

  // A prior rig may contain only lenses.
  bool has_layout() const {
    if (!options_.prior) return false;
    const std::vector<Camera>& cameras = options_.prior->cameras;
    return std::any_of(cameras.begin(), cameras.end(),
                       [&](const Camera& camera) { return camera.pose.position != cameras[0].pose.position; });
  }

  bool nominal_layout() {
    std::vector<Pose> poses;
    for (size_t i = 0; i < tracks_.cameras.size(); i++) {
      const Pose& pose = options_.prior->cameras[*options_.prior->index_of_id(tracks_.cameras[i].id)].pose;
      // Relative to the first camera, to keep precision far from the origin.
      scene().cameras[i].set_pose({pose.position - options_.prior->cameras[0].pose.position, pose.orientation});
      scene().cameras[i].used = true;
      poses.push_back(pose);
    }
    if (!(neighbour_distance(poses) > 0)) return false;
    triangulate_from_poses(scene(), tracks_, 4 * kCoarse);
    return true;
  }

  double sigma_now() { return sigma_of(scene(), tracks_); }

  void robust(const Tracks& tracks, const std::array<bool, kNumLensTerms>& free, size_t rounds, int iterations = 4) {
    AdjustmentOptions o = solution_.model;
    o.free = free;
    adjust_robustly(scene(), tracks, o, 1e-3, std::vector<int>(rounds, iterations));
  }
  void robust_shared_f(const Tracks& tracks, size_t rounds) {
    solution_.model.shared[kF] = true;
    robust(tracks, {true}, rounds);
    solution_.model.shared[kF] = false;
  }

  void complete() {
    const double reach = std::min(kCoarse, 6 * sigma_now());
    triangulate_targets(scene(), tracks_, reach);
    drop_poor_cameras(scene(), tracks_.observations, 6 * sigma_now());
    if (resect_cameras(scene(), tracks_, kCoarse) > 0) triangulate_targets(scene(), tracks_, reach);
    robust(sample_, {}, 2);
  }

  void free_lenses() {
    // Free principal points absorb correlated errors of features, and focal lengths follow. Principal points therefore
    // have a common value, unless the model selection estimates each principal point.
    if (may_be_alike()) solution_.model.shared[kCx] = solution_.model.shared[kCy] = true;
    if (!tracks_.board.empty()) {
      robust(sample_, {true, true, true, true, true}, 3, 8);
    } else if (!scene().measured(kF)) {
      robust_shared_f(sample_, 1);
      robust(sample_, {true, true, true}, 1);
    }
    // For feature tracks, the sample counts alone: their errors are correlated, and more observations would overstate
    // the evidence.
    const size_t num_observations = (tracks_.ordered ? tracks_ : sample_).observations.size();
    // Other models than OPENCV need all their radial terms, because terms that are not estimated depend on them.
    const bool general =
        std::ranges::any_of(scene().cameras, [](const auto& camera) { return camera.fixed.is_general; });
    if (options_.distortion || scene().measured(kK1) || general) {
      solution_.distortion = options_.distortion.value_or(DistortionModel{2, false, scene().measured(kP1)});
    } else {
      step("distortion");
      ModelChoice choice = choose_distortion(scene(), sample_, solution_.model, num_observations);
      solution_.distortion = choice.model;
      solution_.trials = std::move(choice.trials);
    }
    apply_model(solution_.distortion, solution_.model);
    for (CameraState& camera : scene().cameras)
      for (int k = solution_.distortion.terms; k < 2; k++) camera.lens_terms()[kK1 + k] = 0;
    robust(sample_, solution_.model.free, 3, 8);
    if (!options_.distortion && !solution_.distortion.tangential && solution_.distortion.terms > 0) {
      solution_.distortion.tangential = choose_tangential(scene(), sample_, solution_.distortion, solution_.model,
                                                          num_observations, solution_.trials);
      apply_model(solution_.distortion, solution_.model);
    }
    if (!tracks_.board.empty()) {
      robust(tracks_, solution_.model.free, 2, 8);
      drop_poor_cameras(scene(), tracks_.observations, std::max(2.0, 6 * sigma_now()));
      return;
    }
    before_ = count_used();
    try_left_out_cameras();
    triangulate_targets(scene(), tracks_, 4 * sigma_of(scene(), sample_));
    robust(tracks_, solution_.model.free, 2, 8);
  }

  // Resects the remaining cameras with the estimated lens of the batch, or with a longer or shorter focal length.
  // Returns true if cameras were added.
  bool try_left_out_cameras() {
    bool any = false;
    for (const double longer : {1.0, 0.8, 1.25, 0.64, 1.56}) {
      for (int more = 1; more > 0;) {
        bool left_out = false;
        for (size_t i = 0; i < scene().cameras.size(); i++) {
          CameraState& camera = scene().cameras[i];
          if (camera.used) continue;
          left_out = true;
          for (int k = 0; k < kNumLensTerms; k++)
            if (!scene().measured(i, k)) camera.lens_terms()[k] = (k == kF ? longer : 1) * scene().batch_mean[k];
        }
        if (!left_out) return any;
        more = resect_cameras(scene(), tracks_, kCoarse);
        if (more == 0) break;
        any = true;
        triangulate_targets(scene(), tracks_, kCoarse);
        robust(tracks_, solution_.model.free, 2, 8);
        drop_poor_cameras(scene(), tracks_.observations, std::max(2.0, 6 * sigma_now()));
        if (count_used() <= before_) break;  // repeatedly resected, but never fits
        before_ = count_used();
      }
      if (scene().measured(kF)) break;
    }
    return any;
  }
  size_t count_used() { return scene().used_poses().size(); }

  void finish() {
    AdjustmentOptions o = solution_.model;
    o.sigma = sigma_now();
    Inliers inliers = within(residual_lengths(scene(), tracks_.observations), kOutlier, o.sigma);
    for (int round = 0; round < 6; round++) {
      o.max_iterations = 30;
      o.tolerance = 1e-7;
      o.trust = 1e6;
      adjust(scene(), tracks_.observations, inliers, o);
      const auto lengths = residual_lengths(scene(), tracks_.observations);
      // The sigma of all inliers would grow and admit more and more outliers.
      const double sigma = tracks_.ordered ? std::max(kMinSigma, noise_of(lengths, inliers)) : sigma_now();
      Inliers next = within(lengths, kOutlier, sigma);
      const size_t changed = inliers.size() - std::inner_product(next.begin(), next.end(), inliers.begin(), size_t{0},
                                                                 std::plus<>(), std::equal_to<>());
      const bool same =
          changed <= (tracks_.ordered ? 0 : inliers.size() / 1000) && std::abs(sigma / o.sigma - 1) < 0.01;
      inliers = std::move(next);
      o.sigma = sigma;
      if (same) break;
    }
    solution_.inliers = inliers;
    solution_.model.sigma = o.sigma;
  }

  // Down-weights noisy cameras (out of focus, or with unmodelled distortion), so that their observations are not
  // outliers. Returns true if there is a noisy camera.
  bool weigh_cameras() {
    solution_.camera_noise = noise_of_cameras(scene(), tracks_.observations);
    bool any = false;
    for (Observation& o : tracks_.observations) {
      const double noise = solution_.camera_noise[o.camera];
      if (noise > 1) o.sigma *= noise, any = true;
    }
    return any;
  }

  bool may_be_alike() { return !tracks_.ordered && !scene().measured(kF) && !scene().measured(kCx); }

  void weigh_tracks() {
    estimate_track_noise(scene(), tracks_);
    finish();
    if (may_be_alike()) {
      const auto shared = solution_.model.shared;
      choose_shared_terms(scene(), subsample_tracks(tracks_, 3 * kMaxInitialObservations), solution_.model,
                          solution_.trials);
      if (solution_.model.shared != shared) finish();
    }
    estimate_track_noise(scene(), tracks_);
    finish();
  }

  void compare_halves() {
    solution_.disagreement = disagreement_of_halves(scene(), tracks_, solution_.inliers, solution_.model);
    if (!(solution_.disagreement > 1)) return;
    solution_.model.sigma *= solution_.disagreement;
    AdjustmentOptions o = solution_.model;  // updates the weight of priors
    adjust(scene(), tracks_.observations, solution_.inliers, o);
    solution_.uncertainty = estimate_uncertainty(scene(), tracks_.observations, solution_.inliers, solution_.model);
  }

  void use_known_poses() {
    if (!has_known_poses(options_)) return;
    const PosePriorResult use =
        use_pose_priors(scene(), tracks_, options_,
                        estimate_uncertainty(scene(), tracks_.observations, solution_.inliers, solution_.model));
    solution_.contradicted_poses = use.contradicted;
    if (use.any) finish();
  }

  double noise_of(const std::vector<double>& lengths, const Inliers& inliers) {
    return inlier_sigma(scene(), tracks_.observations, lengths, inliers, solution_.model, solution_.uncertainty);
  }

  // Estimates noise and uncertainty alternately, because they depend on each other if there are priors.
  void judge() {
    const auto lengths = residual_lengths(scene(), tracks_.observations);
    std::vector<double> good;
    for (size_t i = 0; i < lengths.size(); i++)
      if (solution_.inliers[i]) good.push_back(lengths[i]);
    solution_.expected_rms = std::sqrt(2) * robust_sigma(good);
    for (int round = 0; round < 2; round++) {
      const double before = solution_.model.sigma;
      solution_.uncertainty = estimate_uncertainty(scene(), tracks_.observations, solution_.inliers, solution_.model);
      solution_.model.sigma = std::max(kMinSigma, noise_of(lengths, solution_.inliers));
      if (std::abs(solution_.model.sigma / before - 1) < 0.01) break;
    }
    solution_.sigma = solution_.model.sigma;
  }

  Tracks tracks_;  // a copy, with estimated sigmas
  const SolveOptions& options_;
  const Tracks sample_;
  size_t before_ = 0;  // number of used cameras before the last attempt to add some
  Solution solution_;
};

}  // namespace

std::string DistortionModel::name() const {
  if (terms == 0) return tangential ? "p1, p2, per camera" : "none";
  return std::string(terms == 1 ? "k1" : "k1, k2") + (tangential ? (shared ? ", alike; p1, p2" : ", p1, p2") : "") +
         (shared && !tangential ? ", alike" : ", per camera");
}

Solution solve_tracks(const Tracks& tracks, const SolveOptions& options) {
  return RigSolver(tracks, options).run(std::nullopt);
}

Solution solve_from_layout(Reconstruction layout, const Tracks& tracks, const SolveOptions& options) {
  return RigSolver(tracks, options).run(std::move(layout));
}

namespace {

constexpr double kHeldOut = 0.1;
constexpr int kMinTargetDetections = 4;  // minimum of a target with a held-out observation
constexpr DistortionModel kModels[] = {{0, false}, {1, true}, {1, false}, {2, true}, {2, false}};

struct ModelFit {
  Reconstruction scene;
  std::vector<double> lengths;
  double sigma;
};

ModelFit fit_model(Reconstruction scene, const Tracks& tracks, const AdjustmentOptions& options, int iterations) {
  adjust_robustly(scene, tracks, options, 3e-4, {iterations / 2, iterations});
  ModelFit fit{std::move(scene), {}, 0};
  fit.lengths = residual_lengths(fit.scene, tracks.observations);
  fit.sigma = std::max(kMinSigma, robust_sigma(fit.lengths));
  return fit;
}

std::vector<size_t> hold_out(const Tracks& tracks, const ModelFit& best) {
  std::vector<int> sights(tracks.num_positions * 2);
  // The other corners of a board tell where a corner is.
  const auto light = [&](size_t i) {
    const Observation& o = tracks.observations[i];
    return o.position * 2 + (tracks.board.empty() ? o.light : 0);
  };
  const Inliers good = within(best.lengths, kOutlier, best.sigma);
  std::vector<size_t> order;
  for (size_t i = 0; i < good.size(); i++)
    if (good[i]) sights[light(i)]++, order.push_back(i);
  std::shuffle(order.begin(), order.end(), std::mt19937(1));
  const auto most = static_cast<size_t>(kHeldOut * static_cast<double>(order.size()));
  std::vector<size_t> held;
  for (const size_t i : order) {
    if (held.size() >= most) break;
    if (sights[light(i)] < kMinTargetDetections) continue;
    sights[light(i)]--;
    held.push_back(i);
  }
  return held;
}

double transfer(const ModelFit& fit, const Tracks& tracks, AdjustmentOptions options, const std::vector<size_t>& held) {
  Inliers use = within(fit.lengths, 2 * kOutlier, fit.sigma);
  for (const size_t i : held) use[i] = false;
  options.sigma = fit.sigma, options.robust = kRobust, options.max_iterations = 2, options.tolerance = 1e-3;
  Reconstruction scene = fit.scene;
  adjust(scene, tracks.observations, use, options);
  const auto lengths = residual_lengths(scene, tracks.observations);
  double sum = 0;
  for (const size_t i : held) sum += lengths[i] * lengths[i];
  return held.empty() ? 0 : std::sqrt(sum / static_cast<double>(held.size()));
}

double count_parameters(const Reconstruction& scene, const AdjustmentOptions& options) {
  const auto cameras = static_cast<double>(scene.used_poses().size());
  double count = 0;
  for (int k = 0; k < kNumLensTerms; k++)
    if (options.free[k]) count += options.shared[k] ? 1 : cameras;
  return count;
}

struct Candidate {
  std::string name;
  AdjustmentOptions options;
};

// Returns the index of the model that the tracks support; candidates are ordered by size. Fits start from the previous
// candidate, or from `scene` if it is near one of the candidates.
enum class Start { kPrevious, kScene };
size_t choose(Reconstruction& scene, const Tracks& tracks, const std::vector<Candidate>& candidates, Start from,
              size_t num_observations, std::vector<ModelTrial>& trials) {
  std::vector<ModelFit> fits;
  for (const Candidate& candidate : candidates) {
    Reconstruction start = fits.empty() || from == Start::kScene ? scene : fits.back().scene;
    for (int k = kK1; k <= kK2; k++) {
      if (candidate.options.free[k]) continue;
      for (CameraState& camera : start.cameras) camera.lens_terms()[k] = 0;
      start.batch_mean[k] = 0;
    }
    fits.push_back(fit_model(std::move(start), tracks, candidate.options, from == Start::kScene ? 20 : 6));
  }
  const auto best = std::min_element(fits.begin(), fits.end(),
                                     [](const ModelFit& a, const ModelFit& b) { return a.sigma < b.sigma; });
  const std::vector<size_t> held = hold_out(tracks, *best);
  const size_t first = trials.size();
  size_t chosen = 0;
  for (size_t m = 0; m < fits.size(); m++) {
    double chi2 = 0, count = 0;
    for (const double l : fits[m].lengths)
      if (l >= 0) chi2 += std::min(std::pow(l / best->sigma, 2), kOutlier * kOutlier), count += 2;
    const double parameters = count_parameters(scene, candidates[m].options);
    const double part = static_cast<double>(tracks.observations.size()) / static_cast<double>(num_observations);
    trials.push_back({candidates[m].name, chi2 / part + parameters * std::log(count / part), {}, false});
    ModelTrial& now = trials.back();
    const ModelTrial& before = trials[first + chosen];
    if (m > 0 && now.bic >= before.bic) continue;
    now.transfer_px = transfer(fits[m], tracks, candidates[m].options, held);
    if (m > 0 && *now.transfer_px < *before.transfer_px) chosen = m;
  }
  trials[first + chosen].chosen = true;
  scene = std::move(fits[chosen].scene);
  return chosen;
}

}  // namespace

void apply_model(const DistortionModel& model, AdjustmentOptions& options) {
  options.free = {true, true, true, model.terms >= 1, model.terms >= 2, model.tangential, model.tangential};
  options.shared[kK1] = options.shared[kK2] = model.shared;
}

ModelChoice choose_distortion(Reconstruction& scene, const Tracks& tracks, const AdjustmentOptions& options,
                              size_t num_observations) {
  std::vector<Candidate> candidates;
  for (const DistortionModel& model : kModels) {
    candidates.push_back({model.name(), options});
    apply_model(model, candidates.back().options);
  }
  ModelChoice choice;
  choice.model = kModels[choose(scene, tracks, candidates, Start::kPrevious, num_observations, choice.trials)];
  return choice;
}

bool choose_tangential(Reconstruction& scene, const Tracks& tracks, const DistortionModel& model,
                       const AdjustmentOptions& options, size_t num_observations, std::vector<ModelTrial>& trials) {
  DistortionModel more = model;
  more.tangential = true;
  std::vector<Candidate> candidates = {{model.name(), options}, {more.name(), options}};
  apply_model(more, candidates[1].options);
  std::vector<ModelTrial> tried;
  const size_t chosen = choose(scene, tracks, candidates, Start::kScene, num_observations, tried);
  // The first candidate is already in the table if models were compared before, with a criterion based on another
  // noise. The absolute values are not comparable, so differences are used.
  for (ModelTrial& trial : trials) {
    if (!trial.chosen) continue;
    tried[1].bic += trial.bic - tried[0].bic;
    trial.chosen = chosen == 0;
  }
  trials.insert(trials.end(), tried.begin() + (trials.empty() ? 0 : 1), tried.end());
  return chosen > 0;
}

void choose_shared_terms(Reconstruction& scene, const Tracks& tracks, AdjustmentOptions& options,
                         std::vector<ModelTrial>& trials) {
  std::vector<Candidate> candidates = {
      {"all f, c alike", options}, {"f per camera, c alike", options}, {"f, c per camera", options}};
  for (size_t m = 0; m < candidates.size(); m++) {
    candidates[m].options.shared[kF] = m < 1;
    candidates[m].options.shared[kCx] = candidates[m].options.shared[kCy] = m < 2;
  }
  options = candidates[choose(scene, tracks, candidates, Start::kScene, tracks.observations.size(), trials)].options;
}

}  // namespace lf
