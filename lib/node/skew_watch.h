// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <span>

#include "rig/mesh.h"

namespace lf {

// Tells once when cameras have come to be off the capture times asked of them: by more than a frame time, and for
// longer than a lost frame explains. Without locks.
class SkewWatch {
 public:
  // Requests in a row before a camera counts as off, and before it counts as on again.
  static constexpr int kRequests = 5;

  // What one camera answered a request with. Times in nanoseconds of any one clock.
  struct Frame {
    CameraIndex camera = 0;
    uint64_t taken = 0, wanted = 0;
    uint64_t period = 0;  // nanoseconds between the camera's frames; 0: not known, and the camera is not judged
    uint64_t behind = 0;  // how much later it arrived than frames of this camera can
  };
  struct Report {
    CameraSet cameras;     // ascending; those that have come to be off with this request
    uint64_t skew = 0;     // the largest skew of these cameras, nanoseconds
    uint64_t period = 0;   // frame time of the camera with the largest skew, nanoseconds
    bool is_late = false;  // the frame of the camera with the largest skew is older than asked for
    uint64_t behind = 0;   // `behind` of the frame of that camera
  };
  // Takes the frames that answered a request, ascending cameras; returns what is to be told, if anything.
  std::optional<Report> see(std::span<const Frame> frames);

 private:
  struct State {
    bool off = false;
    int against = 0;  // requests in a row that say otherwise
  };
  std::map<CameraIndex, State> states_;
};

}  // namespace lf
