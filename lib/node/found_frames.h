// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <atomic>
#include <cstdint>
#include <map>
#include <optional>
#include <vector>

#include "node/camera_inputs.h"
#include "node/skew_watch.h"
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

}  // namespace lf
