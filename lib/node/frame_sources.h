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

// Finds the frames that were captured at the time of a request, for requests that are answered together. The class
// searches for each camera's frame only once, so that all answers show the same frames even if new frames arrive
// meanwhile. Not thread-safe.
class FrameLookup {
 public:
  struct Options {
    bool live = false;        // requests for live cameras, which never wait
    uint64_t base_time = 0;   // clock time of the pipeline's running time 0
    int64_t wall_offset = 0;  // time of day (used by live requests) minus clock time, nanoseconds
    // Largest allowed difference between the capture time of a live frame and the requested time, in nanoseconds; 0:
    // unlimited.
    uint64_t max_skew = 0;
    const std::atomic<bool>* cancelled = nullptr;  // frames are not waited for while this is true
  };
  // Prepares the look-up for the time in the request header `moment`, which is the same in all requests. Also tells all
  // cameras that requests have reached this time (CameraFrames::advance()). All arguments must outlive the object.
  FrameLookup(const CameraInputs::Array& array, const RequestHeader& moment, const Options& options);

  // Returns the frame of one of the array's cameras, after waiting for it if necessary (see CameraFrames::find()).
  // Returns nothing if the camera has no frame near the requested time, or if its frames do not have the size in the
  // rig.
  const std::optional<CameraFrame>& find(CameraIndex camera);
  // `time` is the capture time of a frame of this camera. skew_of() returns its difference from the requested time.
  // time_of() converts the capture time to the time base of the requests, for example to the time of day. The results
  // are in nanoseconds.
  uint64_t skew_of(CameraIndex camera, uint64_t time) const;
  uint64_t time_of(CameraIndex camera, uint64_t time) const;

  // Statistics of the live frames: their capture-time errors, and the number of frames that were too far from the
  // requested time (max_skew).
  const std::vector<SkewMonitor::Frame>& skews() const { return skews_; }
  uint64_t stale() const { return stale_; }

 private:
  uint64_t wanted_of(const CameraFrames& frames) const;
  uint64_t convert(uint64_t time, bool of_live_frame, bool to_request) const;
  std::optional<CameraFrame> look_for(CameraIndex camera);

  const CameraInputs::Array& array_;
  const RequestHeader& request_time_;
  const Options options_;
  std::map<CameraIndex, std::optional<CameraFrame>> found_;
  std::vector<SkewMonitor::Frame> skews_;
  uint64_t stale_ = 0;
};

// The images of all cameras for one request, in the form that the renderer needs. Add the frames with add(), and then
// call decode() once. Regions that the request does not need are not decoded.
class FrameSources {
 public:
  // Prepares an empty list of frames. `region` returns the part of a camera's image that the request needs, because
  // compressed frames are decoded only there. `group` is the share group of OpenGL contexts for images in textures; 0:
  // no textures.
  FrameSources(const Rig& rig, std::function<Rect(CameraIndex)> region, gl::ShareGroup group = 0)
      : rig_(rig), region_(std::move(region)), group_(group) {}

  void add(CameraIndex camera, std::optional<CameraFrame> frame);

  // Returns a replacement for a damaged frame, or nothing if there is none.
  using Replace = std::function<std::optional<CameraFrame>(CameraIndex camera, const CameraFrame& damaged)>;
  // Converts all frames to images of `family`, the node's pixel family. Compressed frames are only decoded where
  // needed. Call once, after the last add(). `replace` is called from the threads of `parallel`.
  void decode(PixelFamily family, const Replace& replace, const ParallelFor& parallel);

  // The result for the renderer: one entry for each add(), with the camera and its image. The entry has no image if the
  // frame is missing or damaged.
  const std::vector<Source>& sources() const { return sources_; }
  // Returns the capture time of the frame of sources()[i], which must have an image.
  uint64_t time(size_t i) const { return frames_[i].time; }
  // Number of images that are on the GPU and were not downloaded.
  size_t on_gpu() const;

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
