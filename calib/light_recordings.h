// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <string>
#include <vector>

#include "calibration/light_report.h"
#include "calibration/light_sights.h"
#include "rig/rig.h"

// What recordings of a moving light show, of each camera of a rig.
struct LightRecordings {
  struct Camera {
    lf::LightRecord record;
    lf::LightSummary summary;
    std::string trouble;  // why the recording is of no use, and what to do about it; "": it is of use
  };
  lf::LightSights sights;
  std::vector<Camera> cameras;
  std::vector<lf::Finding> findings;  // findings about all recordings together

  size_t useful() const;
  // "camera 3 (cam_00_03) is black from ...", of each that is of no use.
  std::vector<std::string> troubles(const lf::Rig& rig) const;
};

// Looks through the recordings in `folder` (recording_of()), `threads` at a time, with a progress bar. gst_init() must
// have been called. Throws lf::Error where there is no such folder; recordings that are of no use are said in
// `cameras`.
LightRecordings watch_lights(const lf::Rig& rig, const std::string& folder, bool bar, int threads);
