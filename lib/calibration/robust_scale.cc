// SPDX-License-Identifier: LGPL-2.1-or-later
#include "calibration/robust_scale.h"

#include <algorithm>
#include <cmath>

#include "calibration/triangulation.h"

namespace lf {
std::vector<double> residual_lengths(const Reconstruction& scene, const std::vector<Observation>& observations) {
  std::vector<double> lengths(observations.size(), -1);
  for (size_t i = 0; i < observations.size(); i++) {
    const Observation& o = observations[i];
    const CameraState& camera = scene.cameras[o.camera];
    const TargetState& target = scene.targets[o.position];
    if (!camera.used || !target.has(o.light)) continue;
    const auto e = residual(camera, target, o);
    lengths[i] = e ? glm::length(*e) / o.sigma : 1e6;  // behind the camera: as wrong as can be
  }
  return lengths;
}

double robust_sigma(std::vector<double> lengths) {
  std::erase_if(lengths, [](double l) { return l < 0; });
  if (lengths.empty()) return 0;
  const auto middle = lengths.begin() + static_cast<ptrdiff_t>(lengths.size() / 2);
  std::nth_element(lengths.begin(), middle, lengths.end());
  return *middle / std::sqrt(2 * std::log(2.0));
}

Inliers within(const std::vector<double>& lengths, double reach, double sigma) {
  Inliers inliers(lengths.size());
  for (size_t i = 0; i < lengths.size(); i++) inliers[i] = lengths[i] >= 0 && lengths[i] <= reach * sigma;
  return inliers;
}

namespace {

constexpr double kReach = 3.8;          // sigmas of the track itself to an outlier
constexpr size_t kLeastSights = 4;      // that tell a track's noise
constexpr double kPointParameters = 3;  // that a track's point takes of its residuals
constexpr double kMedianCounts = 4;     // as so many residuals of x or y
constexpr double kHopeless = 10;        // times the median: a track that tells nothing of itself

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
    if (own.size() < kLeastSights) continue;
    const double reach = kReach * robust_sigma(own);
    double sum = 0;
    for (const double l : own)
      if (l <= reach) sum += l * l, noise[j].freedom += 2;
    noise[j].freedom -= kPointParameters;
    noise[j].variance = sum / noise[j].freedom;
    variances.push_back(noise[j].variance);
  }
  if (variances.empty()) return;
  const auto middle = variances.begin() + static_cast<ptrdiff_t>(variances.size() / 2);
  std::nth_element(variances.begin(), middle, variances.end());
  if (!(*middle > 0)) return;
  for (size_t j = 0; j < positions.size(); j++) {
    const auto& [variance, freedom] = noise[j];
    const double sigma = variance < 0
                             ? kHopeless
                             : std::sqrt((variance * freedom / *middle + kMedianCounts) / (freedom + kMedianCounts));
    for (const uint32_t i : positions[j]) tracks.observations[i].sigma = sigma;
  }
}

}  // namespace lf
