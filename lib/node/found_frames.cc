// SPDX-License-Identifier: LGPL-2.1-or-later
#include "node/found_frames.h"

#include <algorithm>

namespace lf {

FoundFrames::FoundFrames(const CameraInputs::Array& array, const RequestHeader& moment, const Options& options)
    : array_(array), moment_(moment), options_(options) {
  for (const auto& [camera, frames] : array.cameras) frames->advance(wanted_of(*frames));
}

// Live frames have clock time and frames of files running time. Live requests name the time of day and others running
// time.
uint64_t FoundFrames::convert(uint64_t time, bool of_live_frame, bool to_request) const {
  if (time == kNoTime) return time;
  const auto offset = static_cast<uint64_t>(moment_.absolute_time ? options_.day_offset : 0);  // added modulo 2^64
  const bool from_clock = to_request ? of_live_frame : moment_.absolute_time,
             to_clock = to_request ? moment_.absolute_time : of_live_frame;
  if (!to_request) time -= offset;
  if (from_clock != to_clock) time = to_clock ? time + options_.base_time : time - std::min(time, options_.base_time);
  return to_request ? time + offset : time;
}

uint64_t FoundFrames::wanted_of(const CameraFrames& frames) const {
  return convert(moment_.target_time, frames.is_live(), false);
}

uint64_t FoundFrames::skew_of(CameraIndex camera, uint64_t time) const {
  const uint64_t wanted = wanted_of(*array_.cameras.at(camera));
  return wanted == kNoTime ? 0 : time_between(time, wanted);
}

uint64_t FoundFrames::time_of(CameraIndex camera, uint64_t time) const {
  return convert(time, array_.cameras.at(camera)->is_live(), true);
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
