// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <atomic>
#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <vector>

#include "base/worker_pool.h"
#include "node/camera_inputs.h"
#include "node/frame_timing.h"
#include "render/sum_renderer.h"
#include "view/view_request.h"

namespace lf {

// The frames of a node's cameras that belong to the moment of some requests. Each is looked for once, so that all that
// is answered of this moment is made of the same frames. Not thread-safe.
class FoundFrames {
 public:
  struct Options {
    bool live = false;                             // the requests are live: nothing is waited for
    uint64_t base_time = 0;                        // clock time of the pipeline's running time 0
    int64_t day_offset = 0;                        // time of day, which live requests name, less clock time
    uint64_t max_skew = 0;                         // nanoseconds that a live camera's frame may be off; 0: any
    const std::atomic<bool>* cancelled = nullptr;  // while it is true nothing is waited for
  };
  // `moment`: what all of the requests begin with. Everything must outlive this. Tells all cameras how far requests
  // have come.
  FoundFrames(const CameraInputs::Array& array, const RequestHeader& moment, const Options& options);

  // Of one of the array's cameras; waits for it (see CameraFrames::find()). Nothing if it has none, or none of about
  // the time asked for, or of another size than the rig has it since that was replaced.
  const std::optional<CameraFrame>& find(CameraIndex camera);
  // What a frame of this camera is off the time asked for, nanoseconds, and its time as requests count it.
  uint64_t skew_of(CameraIndex camera, uint64_t time) const;
  uint64_t time_of(CameraIndex camera, uint64_t time) const;

  // What was found of live cameras, and how much of it was too far off.
  const std::vector<SkewWatch::Frame>& skews() const { return skews_; }
  uint64_t stale() const { return stale_; }

 private:
  uint64_t wanted_of(const CameraFrames& frames) const;
  uint64_t convert(uint64_t time, bool of_live_frame, bool to_request) const;
  std::optional<CameraFrame> look_for(CameraIndex camera);

  const CameraInputs::Array& array_;
  const RequestHeader& moment_;
  const Options options_;
  std::map<CameraIndex, std::optional<CameraFrame>> found_;
  std::vector<SkewWatch::Frame> skews_;
  uint64_t stale_ = 0;
};

// The frames that one request is answered from, held, and decoded where the request looks.
class FrameSources {
 public:
  // `region`: what is needed of a camera's image. `group`: images may be in textures of its contexts; 0: they may not.
  FrameSources(const Rig& rig, std::function<Rect(CameraIndex)> region, gl::ShareGroup group = 0)
      : rig_(rig), region_(std::move(region)), group_(group) {}

  // Adds a camera's frame; nothing: the camera has none.
  void add(CameraIndex camera, std::optional<CameraFrame> frame);

  // What serves in place of a damaged frame, if anything does.
  using Replace = std::function<std::optional<CameraFrame>(CameraIndex camera, const CameraFrame& damaged)>;
  // Call once after the last add(): makes images of `family` (of the node), of compressed frames of what the view
  // needs. `replace` is called from the threads of `parallel`.
  void decode(PixelFamily family, const Replace& replace, const ParallelFor& parallel);

  // The sources of the request; those whose frame is gone or damaged have no image.
  const std::vector<Source>& sources() const { return sources_; }
  // Capture time of a source's frame; sources()[i] has an image.
  uint64_t time(size_t i) const { return frames_[i].time; }
  // How many of the images are on a card, and have not come here all the same.
  size_t on_card() const;
  // The family of the images; kNone if there are none.
  PixelFamily family() const;

 private:
  void decode_one(size_t i, PixelFamily family, const Replace& replace);

  const Rig& rig_;
  const std::function<Rect(CameraIndex)> region_;
  const gl::ShareGroup group_;
  std::vector<Source> sources_;
  std::vector<CameraFrame> frames_;
  std::vector<std::shared_ptr<const ImageView>> views_;
};

}  // namespace lf
