// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "cameras/rig_cameras.h"
#include "image/image.h"
#include "rig/rig.h"

namespace lf::cameras {

struct RecordingOptions {
  std::vector<CameraIndex> cameras;  // which; empty: all
  bool trusted = false;              // the rig may run any element, see rig/source_security.h
  double seconds = 60;               // from when all are open
  double patience = 10;              // seconds until all give frames; those that don't are left out
  RigCameras::OnFrame seen;          // every frame, in the thread that brings it; may be none
  RigCameras::OnFrame shown;         // the same, from when the films begin on
};

// What there is of a camera.
struct Recorded {
  CameraIndex camera = 0;
  uint64_t frames = 0;
  std::string problem;  // why there is nothing, or not all; "": all is well
  std::string note;     // what is to be known of its frames, "": nothing
};

// Films with all cameras of the rig that was read from `path`, opened as the light field opens them: FOLDER/NAME.mkv of
// each, Motion JPEG, where JPEG comes as it does. Stamps are capture times by one clock, 0 when all are open, without
// the offsets that the rig has: a calibration finds these anew. `told` is called with how much is done (0 to 1; less
// than 0: cameras are being opened) and says whether to go on; what there is when it says no is kept. Films of before
// stay until the end, and also where no camera gives a frame. In the order of the cameras. Throws Error where
// GStreamer's parts or the folder are missing, or names are none of files.
std::vector<Recorded> record_cameras(std::shared_ptr<const Rig> rig, const std::string& path, const std::string& folder,
                                     const RecordingOptions& options, const std::function<bool(double)>& told);

struct SnapshotOptions {
  std::vector<CameraIndex> cameras;  // indices of the cameras; empty: all
  bool trusted = false;              // the rig may run any element, see rig/source_security.h
  double warm_up = 2;                // seconds that cameras run before, in which they adjust to the light
  double patience = 10;              // seconds until all give frames; those that don't are left out
};

// A camera's picture of the instant.
struct Still {
  CameraIndex camera = 0;
  Image rgb;            // empty: there is none
  double off = 0;       // seconds after the instant at which it was taken
  std::string problem;  // why there is none
};

// Takes of each camera of the rig that was read from `path` the frame that is nearest to one instant, which lies behind
// the warm-up of all. In the order of the cameras. Throws Error where GStreamer's parts are missing.
std::vector<Still> take_snapshot(std::shared_ptr<const Rig> rig, const std::string& path,
                                 const SnapshotOptions& options);

}  // namespace lf::cameras
