// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <map>

#include "rig/rig.h"

namespace lf {

// What the images of some cameras are divided by so that all of an array are equally bright. Surfaces shine, so that
// cameras of the same exposure seem to differ by a few percent, too: the nearer to 1 a measured gain is, the less is
// made of it. A plain value without locks.
class CameraGains {
 public:
  static constexpr float kLeast = 0.5f, kMost = 2;  // what differs by more is another fault than exposure
  static constexpr float kShine = 0.02f;            // logarithm of a gain that is as likely shine as exposure

  float of(CameraIndex camera) const;  // 1 before anything is known of it
  // How likely the camera is as bright as it should be, 0..1: in what all have in common such cameras count.
  float trust(CameraIndex camera) const;
  // The camera, divided by its gain, is `ratio` times as bright as the others are by theirs.
  void update(CameraIndex camera, float ratio);
  const std::map<CameraIndex, float>& measured() const { return measured_; }

 private:
  float log_of(CameraIndex camera) const;

  std::map<CameraIndex, float> measured_;
};

}  // namespace lf
