// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "image/image.h"
#include "rig/rig.h"

namespace lf::cameras {

struct SnapshotOptions {
  std::vector<CameraIndex> cameras;  // indices of the cameras; empty: all
  bool trusted = false;              // the rig may run any element, see rig/rig_trust.h
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
