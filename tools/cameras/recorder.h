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
  std::vector<CameraIndex> cameras;  // indices of the cameras; empty: all cameras
  bool trusted = false;
  double seconds = 60;        // seconds, from when all cameras are open
  double timeout = 10;        // seconds to wait for first frames; late cameras are left out
  RigCameras::OnFrame seen;   // receives every frame on the delivering thread; optional
  RigCameras::OnFrame shown;  // receives recorded frames only
};

struct RecordedCamera {
  CameraIndex camera = 0;
  uint64_t frames = 0;
  std::string problem;  // why the recording is missing or incomplete; "": success
  std::string note;     // remark on the frames; "": none
};

// Records all cameras of the rig, which was read from `path`, as FOLDER/NAME.mkv in Motion JPEG. JPEG frames are stored
// unchanged. Timestamps are capture times on one common clock, 0 when all cameras are open. They do not include the
// time offsets in the rig, because a calibration estimates these offsets again.
//
// `on_progress` receives the progress (0 to 1; negative while cameras open). Recording stops and keeps its result when
// `on_progress` returns false. Existing recordings are replaced only at the end, and only if a camera delivered frames.
// Results are in the order of the cameras. Throws Error if GStreamer elements or the folder are missing, or if camera
// names are not valid file names.
std::vector<RecordedCamera> record_cameras(std::shared_ptr<const Rig> rig, const std::string& path,
                                           const std::string& folder, const RecordingOptions& options,
                                           const std::function<bool(double)>& on_progress);

struct SnapshotOptions {
  std::vector<CameraIndex> cameras;  // indices of the cameras; empty: all cameras
  bool trusted = false;
  double warm_up = 2;   // seconds for automatic exposure to converge
  double timeout = 10;  // seconds to wait for first frames; late cameras are left out
};

struct SnapshotImage {
  CameraIndex camera = 0;
  Image rgb;       // empty: no frame
  double off = 0;  // offset from the snapshot time, seconds
  std::string problem;
};

// Takes, for each camera of the rig that was read from `path`, the frame nearest to one instant after the warm-up of
// all cameras. Results are in the order of the cameras. Throws Error if GStreamer elements are missing.
std::vector<SnapshotImage> take_snapshot(std::shared_ptr<const Rig> rig, const std::string& path,
                                         const SnapshotOptions& options);

}  // namespace lf::cameras
