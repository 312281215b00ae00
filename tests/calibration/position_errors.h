// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cmath>
#include <vector>

#include "calibration/adjustment.h"
#include "calibration/reconstruction.h"
#include "rig/rig.h"

namespace lf::sim {

// How far the cameras in use are from where they truly are, once the best similarity has laid the scene over the truth:
// metres in the truth's frame.
inline std::vector<Vec3> position_errors(const Reconstruction& scene, const Rig& truth) {
  std::vector<Pose> found, expected;
  for (size_t i = 0; i < truth.cameras.size(); i++) {
    if (!scene.cameras[i].used) continue;
    found.push_back(scene.cameras[i].pose());
    expected.push_back(truth.cameras[i].pose);
  }
  const Similarity s = align(found, expected);
  std::vector<Vec3> errors;
  for (size_t i = 0; i < found.size(); i++) errors.push_back(s(found[i]).position - expected[i].position);
  return errors;
}

// The root of the mean squared length of what `part` leaves of each of them: all of it, or its share in a plane.
template <typename Part>
double root_mean_square(const std::vector<Vec3>& errors, const Part& part) {
  double sum = 0;
  for (const Vec3& error : errors) sum += glm::dot(part(error), part(error));
  return std::sqrt(sum / static_cast<double>(errors.size()));
}

}  // namespace lf::sim
