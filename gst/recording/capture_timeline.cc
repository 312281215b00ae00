// SPDX-License-Identifier: LGPL-2.1-or-later
#include "recording/capture_timeline.h"

#include <algorithm>
#include <cstdlib>
#include <utility>

namespace lf {

// Of a camera that was away meanwhile only the others tell by which clock it is dated.
bool CaptureTimeline::belongs_to_latest(gint64 time, const Camera& camera) const {
  if (camera.offset == offset_) return false;
  if (time < camera.newest - kSetBack) return true;
  const gint64 by_latest = time - camera.offset + offset_;
  return time > camera.newest + kSetBack && std::abs(by_latest - newest_) < std::abs(time - newest_);
}

CaptureTimeline::Place CaptureTimeline::place(uint32_t number, GstClockTime captured) {
  Camera& camera = cameras_[number];
  const gint64 taken = static_cast<gint64>(captured) - begin_;
  if (belongs_to_latest(taken + camera.offset, camera)) camera.offset = offset_;
  Place place{taken + camera.offset, 0};
  if (camera.is_seen && place.time < camera.newest - kSetBack) {
    const gint64 since = camera.stray ? taken - *camera.stray : 0;
    camera.stray = taken;
    if (since <= 0 || since > kSetBack) return place;
    const gint64 next = camera.newest + camera.period + since;
    place.set_back = next - place.time;
    place.time = next;
    camera.offset = offset_ = next - taken;
  }
  if (place.time < 0) return place;
  camera.stray.reset();
  if (place.time > camera.newest) {
    if (camera.is_seen && place.time - camera.newest <= kSetBack) camera.period = place.time - camera.newest;
    camera.newest = place.time;
  }
  camera.is_seen = true;
  newest_ = std::max(newest_, place.time);
  return place;
}

}  // namespace lf
