// SPDX-License-Identifier: LGPL-2.1-or-later
#include "calibration/model_choice.h"

#include <algorithm>
#include <cmath>
#include <random>

#include "calibration/noise.h"

namespace lf {
namespace {

constexpr double kHeldOut = 0.1;  // share of the observations
constexpr int kLeastTargetSights = 4;   // of a target that gives one up
constexpr double kChoiceRobust = 2;
constexpr double kChoiceSettled = 0.05;  // change of sigma
constexpr DistortionModel kModels[] = {{0, false}, {1, true}, {1, false}, {2, true}, {2, false}};

struct ModelFit {
  Reconstruction scene;
  std::vector<double> lengths;
  double sigma;
};

ModelFit fit_model(Reconstruction scene, const Tracks& tracks, AdjustmentOptions options, int iterations) {
  const Inliers all(tracks.observations.size(), true);
  options.robust = kChoiceRobust, options.tolerance = 3e-4;
  for (int round = 0; round < 2; round++) {
    options.max_iterations = round == 0 ? iterations / 2 : iterations;
    const double sigma = std::max(1e-3, robust_sigma(residual_lengths(scene, tracks.observations)));
    if (round > 0 && std::abs(sigma / options.sigma - 1) < kChoiceSettled) break;
    options.sigma = sigma;
    adjust(scene, tracks.observations, all, options);
  }
  ModelFit fit{std::move(scene), {}, 0};
  fit.lengths = residual_lengths(fit.scene, tracks.observations);
  fit.sigma = std::max(1e-3, robust_sigma(fit.lengths));
  return fit;
}

// Sights that seem right, of targets that can do without one: at most one each.
std::vector<size_t> hold_out(const Tracks& tracks, const ModelFit& best) {
  std::vector<int> sights(tracks.num_positions * 2);
  const auto light = [&](size_t i) { return tracks.observations[i].position * 2 + tracks.observations[i].light; };
  const Inliers good = within(best.lengths, kOutlier, best.sigma);
  std::vector<size_t> order;
  for (size_t i = 0; i < good.size(); i++)
    if (good[i]) sights[light(i)]++, order.push_back(i);
  std::shuffle(order.begin(), order.end(), std::mt19937(1));
  const auto most = static_cast<size_t>(kHeldOut * static_cast<double>(order.size()));
  std::vector<size_t> held;
  for (const size_t i : order) {
    if (held.size() >= most) break;
    if (sights[light(i)] < kLeastTargetSights) continue;
    sights[light(i)]--;
    held.push_back(i);
  }
  return held;
}

double transfer(const ModelFit& fit, const Tracks& tracks, AdjustmentOptions options, const std::vector<size_t>& held) {
  Inliers use = within(fit.lengths, 2 * kOutlier, fit.sigma);
  for (const size_t i : held) use[i] = false;
  options.sigma = fit.sigma, options.robust = kChoiceRobust, options.max_iterations = 2, options.tolerance = 1e-3;
  Reconstruction scene = fit.scene;
  adjust(scene, tracks.observations, use, options);
  const auto lengths = residual_lengths(scene, tracks.observations);
  double sum = 0;
  for (const size_t i : held) sum += lengths[i] * lengths[i];
  return held.empty() ? 0 : std::sqrt(sum / static_cast<double>(held.size()));
}

double count_parameters(const Reconstruction& scene, const AdjustmentOptions& options) {
  const auto cameras = std::count_if(scene.cameras.begin(), scene.cameras.end(), [](const auto& c) { return c.used; });
  double count = 0;
  for (int k = 0; k < kNumLensTerms; k++)
    if (options.free[k]) count += options.shared[k] ? 1 : static_cast<double>(cameras);
  return count;
}

struct Candidate {
  std::string name;
  AdjustmentOptions options;
};

// Of candidates from the smallest model to the largest: the index of the one that the tracks call for. Each starts from
// the one before it, or from `scene`, which is near one of them.
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
  // The first is in the table already, where others were tried, with a criterion that counts from another noise: only
  // differences mean something.
  for (ModelTrial& trial : trials) {
    if (!trial.chosen) continue;
    tried[1].bic += trial.bic - tried[0].bic;
    trial.chosen = chosen == 0;
  }
  trials.insert(trials.end(), tried.begin() + (trials.empty() ? 0 : 1), tried.end());
  return chosen > 0;
}

void choose_alike(Reconstruction& scene, const Tracks& tracks, AdjustmentOptions& options,
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
