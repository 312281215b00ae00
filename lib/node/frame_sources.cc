// SPDX-License-Identifier: LGPL-2.1-or-later
#include "node/frame_sources.h"

#include <algorithm>

#include "image/image.h"

namespace lf {

FrameLookup::FrameLookup(const CameraInputs::Array& array, const RequestHeader& moment, const Options& options)
    : array_(array), request_time_(moment), options_(options) {
  for (const auto& [camera, frames] : array.cameras) frames->advance(wanted_of(*frames));
}

// Live frames carry clock time, and frames of files carry running time. Live requests name the time of day, other
// requests the running time.
uint64_t FrameLookup::convert(uint64_t time, bool of_live_frame, bool to_request) const {
  if (time == kNoTime) return time;
  const auto offset = static_cast<uint64_t>(request_time_.absolute_time ? options_.wall_offset : 0);  // modulo 2^64
  const bool from_clock = to_request ? of_live_frame : request_time_.absolute_time,
             to_clock = to_request ? request_time_.absolute_time : of_live_frame;
  if (!to_request) time -= offset;
  if (from_clock != to_clock) time = to_clock ? time + options_.base_time : time - std::min(time, options_.base_time);
  return to_request ? time + offset : time;
}

uint64_t FrameLookup::wanted_of(const CameraFrames& frames) const {
  return convert(request_time_.target_time, frames.is_live(), false);
}

uint64_t FrameLookup::skew_of(CameraIndex camera, uint64_t time) const {
  const uint64_t wanted = wanted_of(*array_.cameras.at(camera));
  return wanted == kNoTime ? 0 : time_between(time, wanted);
}

uint64_t FrameLookup::time_of(CameraIndex camera, uint64_t time) const {
  return convert(time, array_.cameras.at(camera)->is_live(), true);
}

std::optional<CameraFrame> FrameLookup::look_for(CameraIndex camera) {
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

const std::optional<CameraFrame>& FrameLookup::find(CameraIndex camera) {
  const auto known = found_.find(camera);
  return known != found_.end() ? known->second : found_.emplace(camera, look_for(camera)).first->second;
}

void FrameSources::add(CameraIndex camera, std::optional<CameraFrame> frame) {
  sources_.push_back({camera, &rig_.cameras[camera], {}});
  frames_.push_back(frame ? std::move(*frame) : CameraFrame{});
}

void FrameSources::decode_one(size_t i, PixelFamily family, const Replace& replace) {
  while (CameraPicture* picture = frames_[i].picture.get()) {
    if (const ImageView* on_gpu = group_ == 0 ? nullptr : picture->view_on_gpu(family, group_)) {
      sources_[i].image = *on_gpu;
      return;
    }
    views_[i] = picture->view(family, picture->is_compressed() ? region_(sources_[i].camera) : Rect{});
    if (views_[i]) {
      sources_[i].image = *views_[i];
      return;
    }
    frames_[i] = replace(sources_[i].camera, frames_[i]).value_or(CameraFrame{});
  }
}

void FrameSources::decode(PixelFamily family, const Replace& replace, const ParallelFor& parallel) {
  views_.resize(sources_.size());
  std::vector<size_t> shared;
  for (size_t i = 0; i < sources_.size(); i++) {
    if (frames_[i].picture && frames_[i].picture->takes_work(family))
      shared.push_back(i);
    else
      decode_one(i, family, replace);
  }
  parallel(shared.size(), [&](size_t k) { decode_one(shared[k], family, replace); });
}

size_t FrameSources::on_gpu() const {
  return static_cast<size_t>(std::ranges::count_if(sources_, [](const Source& source) {
    return source.image.on_gpu.image && !source.image.on_gpu.image->is_fetched();
  }));
}

}  // namespace lf
