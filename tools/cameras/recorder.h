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
  std::vector<CameraIndex> cameras;  // empty: all cameras
  bool trusted = false;
  double seconds = 60;        // length of the recording after all cameras are open, seconds
  double timeout = 10;        // maximum time until the first frame, seconds; later cameras are left out
  RigCameras::OnFrame seen;   // optional; receives every frame on the thread that delivers the frame
  RigCameras::OnFrame shown;  // optional; receives only frames that are recorded
};

struct RecordedCamera {
  CameraIndex camera = 0;
  uint64_t frames = 0;
  std::string problem;  // why the recording is missing or incomplete; empty after success
  std::string note;     // remark on the recording; may be empty
};

// Records cameras of a rig as FOLDER/NAME.mkv in Motion JPEG. `path` is the file of the rig. JPEG frames are stored
// unchanged. Timestamps are capture times on one common clock that starts at 0 when all cameras are open. They do not
// include the time offsets in the rig, because a calibration estimates these offsets again.
//
// Existing recordings are replaced only at the end, and only for cameras that delivered frames. `on_progress` receives
// the progress from 0 to 1, or a negative value while cameras open. If it returns false, the recording stops and keeps
// its result.
//
// Returns the results in the order of the cameras. Throws Error if a GStreamer element or the folder is missing, or if
// camera names are not valid file names.
std::vector<RecordedCamera> record_cameras(std::shared_ptr<const Rig> rig, const std::string& path,
                                           const std::string& folder, const RecordingOptions& options,
                                           const std::function<bool(double)>& on_progress);

struct SnapshotOptions {
  std::vector<CameraIndex> cameras;  // empty: all cameras
  bool trusted = false;
  double warm_up = 2;   // time for automatic exposure to converge, seconds
  double timeout = 10;  // maximum time until the first frame, seconds; later cameras are left out
};

struct SnapshotImage {
  CameraIndex camera = 0;
  Image rgb;       // empty if the camera delivered no frame
  double off = 0;  // offset of the capture time from the snapshot time, seconds
  std::string problem;
};

// Takes one image of each camera at the same time. After all cameras have warmed up, an instant is chosen, and each
// camera contributes the frame nearest to this instant. `path` is the file of the rig. Returns the results in the order
// of the cameras. Throws Error if a GStreamer element is missing.
std::vector<SnapshotImage> take_snapshot(std::shared_ptr<const Rig> rig, const std::string& path,
                                         const SnapshotOptions& options);

}  // namespace lf::cameras
