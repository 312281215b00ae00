// SPDX-License-Identifier: LGPL-2.1-or-later
#include "node/found_frames.h"

#include <algorithm>

namespace lf {

// Live cameras' frames have clock time, those of others running time, and a request may ask in either.
static uint64_t convert_time(uint64_t time, bool from_clock, bool to_clock, uint64_t base_time) {
  if (time == kNoTime || from_clock == to_clock) return time;
  return to_clock ? time + base_time : time - std::min(time, base_time);
}

FoundFrames::FoundFrames(const CameraInputs::Array& array, const RequestHeader& moment, const Options& options)
    : array_(array), moment_(moment), options_(options) {
  for (const auto& [camera, frames] : array.cameras) frames->advance(wanted_of(*frames));
}

uint64_t FoundFrames::wanted_of(const CameraFrames& frames) const {
  return convert_time(moment_.target_time, moment_.absolute_time, frames.is_live(), options_.base_time);
}

uint64_t FoundFrames::skew_of(CameraIndex camera, uint64_t time) const {
  const uint64_t wanted = wanted_of(*array_.cameras.at(camera));
  return wanted == kNoTime ? 0 : time_between(time, wanted);
}

uint64_t FoundFrames::time_of(CameraIndex camera, uint64_t time) const {
  return convert_time(time, array_.cameras.at(camera)->is_live(), moment_.absolute_time, options_.base_time);
}

std::optional<CameraFrame> FoundFrames::look_for(CameraIndex camera) {
  CameraFrames& frames = *array_.cameras.at(camera);
  const uint64_t wanted = wanted_of(frames);
  std::optional<CameraFrame> frame = frames.find(wanted, !options_.live, options_.cancelled);
  if (frame && !frame->fits(array_.rig->cameras[camera])) frame.reset();
  if (!frame || wanted == kNoTime || !frames.is_live() || frames.has_ended()) return frame;
  skews_.push_back({camera, frame->time, wanted, frames.mean_period(), frame->behind});
  if (options_.max_skew > 0 && time_between(frame->time, wanted) > options_.max_skew) {
    frame.reset();
    stale_++;
  }
  return frame;
}

const std::optional<CameraFrame>& FoundFrames::find(CameraIndex camera) {
  const auto known = found_.find(camera);
  return known != found_.end() ? known->second : found_.emplace(camera, look_for(camera)).first->second;
}

}  // namespace lf
