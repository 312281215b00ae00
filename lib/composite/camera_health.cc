// SPDX-License-Identifier: LGPL-2.1-or-later
#include "composite/camera_health.h"

#include <algorithm>
#include <utility>

namespace lf {

void CameraHealth::expect(size_t count) {
  expected_ = count;
  cameras_.resize(std::max(cameras_.size(), count));
  for (size_t i = 0; i < count; i++) cameras_[i].known = true;
}

bool CameraHealth::use_rig(uint64_t hash) {
  if (hash == 0 || hash == rig_) return false;
  if (std::exchange(rig_, hash) == 0) return false;
  const bool any = !out_.empty();
  cameras_.clear();
  out_.clear();
  seen_late_ = {};
  expect(expected_);
  return any;
}

void CameraHealth::seen_late(uint64_t rig, const CameraRanges& seeing) {
  if (rig_ == 0 || rig == rig_) seen_late_.add(seeing);
}

bool CameraHealth::picture(CameraRanges seeing) {
  seeing.add(std::exchange(seen_late_, {}));
  if (max_missed_ == 0 || seeing.empty()) return false;
  cameras_.resize(std::max(cameras_.size(), size_t{seeing.ranges().back().last} + 1));
  bool changed = false;
  const auto set = [&changed](Camera& camera, bool out) {
    changed = changed || camera.out != out;
    camera.out = out;
  };
  for (size_t i = 0; i < cameras_.size(); i++) {
    Camera& camera = cameras_[i];
    if (seeing.contains(static_cast<CameraIndex>(i))) {
      camera.known = true;
      camera.missed = 0;
      camera.seen++;
      if (camera.out && camera.seen >= kBackAfter) set(camera, false);
    } else if (camera.known) {
      camera.seen = 0;
      camera.missed++;
      if (camera.missed > max_missed_) set(camera, true);
    }
  }
  if (!changed) return false;
  out_.clear();
  for (size_t i = 0; i < cameras_.size(); i++)
    if (cameras_[i].out) out_.push_back(static_cast<CameraIndex>(i));
  return true;
}

}  // namespace lf
