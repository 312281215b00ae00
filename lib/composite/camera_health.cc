// SPDX-License-Identifier: LGPL-2.1-or-later
#include "composite/camera_health.h"

#include <algorithm>
#include <utility>

namespace lf {

bool RequestHistory::begin(uint32_t sequence) {
  const std::optional<uint32_t> last = std::exchange(last_, sequence);
  if (!last || static_cast<int32_t>(sequence - *last) >= 0) return false;
  composed_.clear();
  skipped_.clear();
  return true;
}

void RequestHistory::composed(uint32_t sequence, uint64_t deadline) {
  composed_.push_back({sequence, deadline});
  if (composed_.size() > kMost) composed_.pop_front();
}

void RequestHistory::skipped(uint32_t sequence) {
  skipped_.push_back(sequence);
  if (skipped_.size() > kMost) skipped_.pop_front();
}

void RequestHistory::clear() { *this = {}; }

RequestHistory::Answer RequestHistory::judge(uint32_t sequence, uint64_t now) const {
  if (std::ranges::find(skipped_, sequence) != skipped_.end()) return Answer::kToSkipped;
  const auto past = std::ranges::find(composed_, sequence, &Composed::sequence);
  if (past == composed_.end()) return Answer::kLate;
  // Answers are only read when a request arrives, so the arrival time of an answer to the latest composed request is
  // unknown. The answer counts as in time. Otherwise, a node that the compositor does not wait for could never return
  // if requests are as far apart as the deadline.
  const bool is_latest = sequence == composed_.back().sequence;
  return is_latest || now <= past->deadline ? Answer::kInTime : Answer::kLate;
}

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
  late_cameras_ = {};
  expect(expected_);
  return any;
}

void CameraHealth::add_late(uint64_t rig, const CameraRanges& seeing) {
  if (rig_ == 0 || rig == rig_) late_cameras_.add(seeing);
}

bool CameraHealth::picture(CameraRanges seeing) {
  seeing.add(std::exchange(late_cameras_, {}));
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
      if (camera.out && camera.seen >= kRecoveryPictures) set(camera, false);
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
