// SPDX-License-Identifier: LGPL-2.1-or-later
#include "calibration/noise.h"

#include <algorithm>
#include <cmath>

#include <Eigen/Cholesky>

#include "base/maths.h"
#include "calibration/multiview_geometry.h"

namespace lf {

std::vector<double> residual_lengths(const Reconstruction& scene, const std::vector<Observation>& observations) {
  std::vector<double> lengths(observations.size(), -1);
  for (size_t i = 0; i < observations.size(); i++) {
    const Observation& o = observations[i];
    if (!scene.cameras[o.camera].used || !scene.targets[o.position].has(o.light)) continue;
    const auto e = scene.residual_of(o);
    lengths[i] = e ? glm::length(*e) / o.sigma : 1e6;
  }
  return lengths;
}

double robust_sigma(std::vector<double> lengths) {
  std::erase_if(lengths, [](double l) { return l < 0; });
  return lengths.empty() ? 0 : median(std::move(lengths)) / std::sqrt(2 * std::log(2.0));
}

Inliers within(const std::vector<double>& lengths, double reach, double sigma) {
  Inliers inliers(lengths.size());
  for (size_t i = 0; i < lengths.size(); i++) inliers[i] = lengths[i] >= 0 && lengths[i] <= reach * sigma;
  return inliers;
}

void drop_poor_cameras(Reconstruction& scene, const std::vector<Observation>& observations, double reach) {
  const auto lengths = residual_lengths(scene, observations);
  std::vector<double> fit(scene.cameras.size()), all(scene.cameras.size());
  for (size_t i = 0; i < lengths.size(); i++) {
    if (lengths[i] < 0) continue;
    all[observations[i].camera]++;
    fit[observations[i].camera] += lengths[i] < reach;
  }
  for (size_t i = 0; i < fit.size(); i++)
    if (fit[i] < 0.3 * all[i] || all[i] < 4) scene.cameras[i].used = false;
}

double inlier_sigma(const Reconstruction& scene, const std::vector<Observation>& observations,
                    const std::vector<double>& lengths, const Inliers& inliers, const AdjustmentOptions& model,
                    const Uncertainty& uncertainty) {
  constexpr double kKept = 0.9947;  // share of the variance of normal errors within kOutlier
  double sum = 0, count = 0;
  std::vector<char> target_used(scene.targets.size());
  for (size_t i = 0; i < lengths.size(); i++)
    if (inliers[i]) {
      sum += lengths[i] * lengths[i], count += 2;
      target_used[observations[i].position] = true;
    }
  double parameters = -7;
  for (size_t j = 0; j < target_used.size(); j++)
    if (target_used[j]) {
      const TargetState::Kind kind = scene.targets[j].kind;
      parameters += kind == TargetState::Kind::kBoard ? 6 : kind == TargetState::Kind::kBar ? 5 : 3;
    }
  // A parameter with a prior counts by the share of its information that comes from observations, and as one half at
  // first.
  const Uncertainty& u = uncertainty;
  const auto free = static_cast<double>(std::count(model.free.begin(), model.free.end(), true));
  int lens = 0;
  for (size_t i = 0; i < scene.cameras.size(); i++) {
    if (!scene.cameras[i].used) continue;
    parameters += 6;
    if (u.camera_row.empty()) parameters += free / 2;
    for (int k = 0; k < static_cast<int>(u.lens_terms.size()); k++, lens++)
      parameters += 1 - std::min(1.0, u.covariance(u.camera_row[i] + 6 + k, u.camera_row[i] + 6 + k) /
                                          u.prior_covariance(lens, lens));
  }
  return std::sqrt(sum / std::max(1.0, count - parameters) / kKept);
}

std::vector<double> noise_of_cameras(const Reconstruction& scene, const std::vector<Observation>& observations) {
  constexpr size_t kEnough = 30;
  constexpr double kMore = 2, kMost = 4;
  const std::vector<double> lengths = residual_lengths(scene, observations);
  std::vector<std::vector<double>> of_camera(scene.cameras.size());
  for (size_t i = 0; i < lengths.size(); i++)
    if (lengths[i] >= 0) of_camera[observations[i].camera].push_back(lengths[i]);
  std::vector<double> sigmas(scene.cameras.size(), 0), known;
  for (size_t i = 0; i < sigmas.size(); i++) {
    if (of_camera[i].size() < kEnough) continue;
    sigmas[i] = robust_sigma(std::move(of_camera[i]));
    known.push_back(sigmas[i]);
  }
  std::vector<double> noise(scene.cameras.size(), 1);
  if (known.empty()) return noise;
  const double usual = median(std::move(known));
  for (size_t i = 0; i < noise.size(); i++)
    if (usual > 0 && sigmas[i] > kMore * usual) noise[i] = std::min(kMost, sigmas[i] / usual);
  return noise;
}

void retriangulate_weak_targets(Reconstruction& scene, const Tracks& tracks, double weight, double sigma,
                                Inliers& inliers) {
  constexpr int kFirmSights = 3;  // minimum number of observations; two rays always meet nearly, even if wrong
  Tracks nowhere = tracks;
  std::erase_if(nowhere.observations, [&](const Observation& o) { return scene.targets[o.position].has(o.light); });
  if (!tracks.bar) triangulate_targets(scene, nowhere, tracks.cameras[0].width);
  std::vector<int> good(scene.targets.size());
  for (size_t i = 0; i < inliers.size(); i++) good[tracks.observations[i].position] += inliers[i];
  Inliers doubtful(inliers.size());
  for (size_t i = 0; i < doubtful.size(); i++) doubtful[i] = good[tracks.observations[i].position] < kFirmSights;
  AdjustmentOptions o;
  o.sigma = weight, o.robust = 1, o.redescending = false, o.free_poses = false;
  adjust(scene, tracks.observations, doubtful, o);
  const Inliers near = within(residual_lengths(scene, tracks.observations), kOutlier, sigma);
  for (size_t i = 0; i < doubtful.size(); i++)
    if (doubtful[i]) inliers[i] = near[i];
}

namespace {

constexpr size_t kMinNoiseDetections = 4;
constexpr double kPointParameters = 3;  // degrees of freedom of a track's point
constexpr double kMedianCounts = 4;     // weight of the median, in residuals of x or y
constexpr double kHopeless = 10;        // ratio to the median for tracks that are too short

}  // namespace

void estimate_track_noise(const Reconstruction& scene, Tracks& tracks) {
  struct Noise {
    double variance = -1, freedom = 0;
  };
  for (Observation& o : tracks.observations) o.sigma = 1;
  const std::vector<double> lengths = residual_lengths(scene, tracks.observations);
  const auto positions = observations_of_positions(tracks);
  std::vector<Noise> noise(positions.size());
  std::vector<double> variances;
  for (size_t j = 0; j < positions.size(); j++) {
    std::vector<double> own;
    for (const uint32_t i : positions[j])
      if (lengths[i] >= 0) own.push_back(lengths[i]);
    if (own.size() < kMinNoiseDetections) continue;
    const double reach = kOutlier * robust_sigma(own);
    double sum = 0;
    for (const double l : own)
      if (l <= reach) sum += l * l, noise[j].freedom += 2;
    noise[j].freedom -= kPointParameters;
    noise[j].variance = sum / noise[j].freedom;
    variances.push_back(noise[j].variance);
  }
  if (variances.empty()) return;
  const double usual = median(std::move(variances));
  if (!(usual > 0)) return;
  for (size_t j = 0; j < positions.size(); j++) {
    const auto& [variance, freedom] = noise[j];
    const double sigma =
        variance < 0 ? kHopeless : std::sqrt((variance * freedom / usual + kMedianCounts) / (freedom + kMedianCounts));
    for (const uint32_t i : positions[j]) tracks.observations[i].sigma = sigma;
  }
}

namespace {

constexpr int kBlocks = 8;  // across an image, or along a light's path
constexpr int kSplits = 2;  // two splits, because only few modes are weakly constrained
constexpr int kIterations = 8;
using Eigen::VectorXd;

// Returns the half (0 or 1) of each position. The second split shifts the borders by half a block.
std::vector<char> sides(const Tracks& tracks, const std::vector<std::vector<uint32_t>>& positions, int split) {
  std::vector<char> side(positions.size());
  for (size_t j = 0; j < positions.size(); j++) {
    if (tracks.ordered) {
      side[j] = static_cast<char>((2 * kBlocks * j / positions.size() + static_cast<size_t>(split)) / 2 & 1);
    } else if (!positions[j].empty()) {
      const Observation& first = tracks.observations[positions[j][0]];
      const double block = static_cast<double>(tracks.cameras[first.camera].width) / kBlocks;
      const Vec2 at = first.pixel / block + Vec2(0.5, 0.5) * static_cast<double>(split) + Vec2(1, 1);
      side[j] = static_cast<char>((static_cast<int>(at.x) + static_cast<int>(at.y)) & 1);
    }
  }
  return side;
}

struct HalfSolution {
  std::vector<CameraState> cameras;  // aligned with the full solution
  VectorXd variance;                 // variance of the parameters, without the priors that both halves share
};

HalfSolution solve_half(const Reconstruction& whole, const Tracks& tracks, const Inliers& use,
                        AdjustmentOptions options) {
  const Uncertainty u = estimate_uncertainty(whole, tracks.observations, use, options);
  HalfSolution half{whole.cameras, u.covariance.diagonal()};
  const auto lens = static_cast<Eigen::Index>(u.lens_terms.size());
  if (lens > 0) {
    Eigen::MatrixXd by_lens(u.covariance.rows(), u.prior_covariance.rows());
    Eigen::Index column = 0;
    for (const int row : u.camera_row) {
      if (row < 0) continue;
      by_lens.middleCols(column, lens) = u.covariance.middleCols(row + 6, lens);
      column += lens;
    }
    const Eigen::MatrixXd prior = u.prior_covariance.llt().solve(by_lens.transpose());
    half.variance -= by_lens.cwiseProduct(prior.transpose()).rowwise().sum();
  }
  Reconstruction scene = whole;
  options.max_iterations = kIterations;
  adjust(scene, tracks.observations, use, options);
  const Similarity s = align(scene.used_poses(), whole.used_poses(), tracks.rigid_targets());
  half.cameras = std::move(scene.cameras);
  for (CameraState& camera : half.cameras) camera.set_pose(s(camera.pose()));
  return half;
}

}  // namespace

double disagreement_of_halves(const Reconstruction& scene, const Tracks& tracks, const Inliers& use,
                              const AdjustmentOptions& options) {
  const auto positions = observations_of_positions(tracks);
  double sum = 0, count = 0;
  for (int split = 0; split < kSplits; split++) {
    const std::vector<char> side = sides(tracks, positions, split);
    HalfSolution halves[2];
    for (int h = 0; h < 2; h++) {
      Inliers own = use;
      for (size_t i = 0; i < own.size(); i++) own[i] = own[i] && side[tracks.observations[i].position] == h;
      halves[h] = solve_half(scene, tracks, own, options);
    }
    Eigen::Index row = 0;
    for (size_t i = 0; i < scene.cameras.size(); i++) {
      if (!scene.cameras[i].used) continue;
      const CameraState &a = halves[0].cameras[i], &b = halves[1].cameras[i];
      const Quat turn = a.pose().orientation * glm::conjugate(b.pose().orientation);
      const Vec3 rotation = 2.0 * (turn.w < 0 ? -1.0 : 1.0) * Vec3(turn.x, turn.y, turn.z);
      const Vec3 shift = a.pose().position - b.pose().position;
      const auto add = [&](double difference) {
        const double variance = halves[0].variance[row] + halves[1].variance[row];
        row++;
        if (variance > 0) sum += difference * difference / variance, count++;
      };
      for (int k = 0; k < 3; k++) add(rotation[k]);
      for (int k = 0; k < 3; k++) add(shift[k]);
      for (int k = 0; k < kNumLensTerms; k++)
        if (options.free[k]) add(a.lens_terms()[k] - b.lens_terms()[k]);
    }
  }
  return count > 0 ? std::sqrt(sum / count) : 1;
}

}  // namespace lf
