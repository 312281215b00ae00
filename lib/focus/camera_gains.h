// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <map>
#include <optional>

#include "rig/rig.h"

namespace lf {

// What the images of some cameras are divided by so that all of an array are equally bright. A plain value without
// locks.
class CameraGains {
 public:
  static constexpr float kLeast = 0.5f, kMost = 2;  // what differs by more is another fault than exposure
  static constexpr float kStep = 0.7f;              // of the way to what was measured last, in logarithms

  float of(CameraIndex camera) const;  // 1 before anything is known of it
  // The camera, divided by its gain, is `ratio` times as bright as the others are by theirs.
  void update(CameraIndex camera, float ratio);
  const std::map<CameraIndex, float>& all() const { return gains_; }

 private:
  std::map<CameraIndex, float> gains_;
};

}  // namespace lf
