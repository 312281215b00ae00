// SPDX-License-Identifier: LGPL-2.1-or-later
#include "focus/camera_gains.h"

#include <algorithm>
#include <cmath>

namespace lf {

float CameraGains::of(CameraIndex camera) const {
  const auto found = gains_.find(camera);
  return found == gains_.end() ? 1 : found->second;
}

void CameraGains::update(CameraIndex camera, float ratio) {
  gains_[camera] = std::clamp(of(camera) * std::pow(ratio, kStep), kLeast, kMost);
}

}  // namespace lf
