// SPDX-License-Identifier: LGPL-2.1-or-later
#include "calibration/robust_scale.h"

#include <algorithm>
#include <cmath>

namespace lf {

std::vector<double> residual_lengths(const Scene& scene, const std::vector<Observation>& observations) {
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

}  // namespace lf
