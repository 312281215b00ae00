// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "calibration/light_sights.h"
#include "calibration/report.h"

namespace lf {

// What one camera's recording is worth, before any geometry.
struct LightSummary {
  double seconds = 0;
  double lit = 0;                      // share of the pictures in which a light is
  double coverage = 0;                 // share of the picture's places, of 4 x 3, that a moved light came to
  double sigma = 0;                    // median standard deviation of the brightest light's place, pixels
  std::optional<std::string> trouble;  // why the recording is of no use, and what to do about it
  std::vector<std::string> remarks;    // what would make it better
};
LightSummary summarize_lights(const LightSights::Camera& camera, const LightRecord& record);

// What all recordings together show: lengths that differ.
std::vector<Finding> compare_recordings(const LightSights& sights);

}  // namespace lf
