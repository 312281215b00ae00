// SPDX-License-Identifier: LGPL-2.1-or-later
#include "focus/camera_gains.h"

#include <algorithm>
#include <cmath>

namespace lf {

float CameraGains::log_of(CameraIndex camera) const {
  const auto found = measured_.find(camera);
  return found == measured_.end() ? 0 : std::log(found->second);
}

float CameraGains::trust(CameraIndex camera) const {
  const float x = log_of(camera);
  return kShine * kShine / (x * x + kShine * kShine);
}

float CameraGains::of(CameraIndex camera) const { return std::exp((1 - trust(camera)) * log_of(camera)); }

void CameraGains::update(CameraIndex camera, float ratio) {
  measured_[camera] = std::clamp(ratio * of(camera), kLeast, kMost);
}

}  // namespace lf
