// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <optional>
#include <vector>

#include "calibration/light_detector.h"

namespace lf {

// Relation between a camera's stamps and the true capture time, relative to the common clock of all cameras: true time
// = stamp + offset, like `time_offset` in a rig.
struct CameraClock {
  // Dropped frames that left no gap between the stamps.
  struct Step {
    double stamp = 0;    // stamp of the first frame after the dropped frames
    double seconds = 0;  // how much later than their stamps the frames from there on are
    int frames = 0;
  };
  double offset = 0;  // seconds, before the first step
  double sigma = 0;   // standard deviation of the offset, seconds
  double drift = 0;   // seconds per second, about `middle`
  double middle = 0;  // a stamp, seconds
  std::vector<Step> steps;
  bool known = false;  // true if the camera's light motion matches other cameras

  double true_time(double stamp) const;
  double stamp_of(double true_time) const;
};

// Estimates offsets to about a quarter of a frame, without geometry. If clocks are synchronised, the light velocities
// in two cameras are approximately linear functions of each other (canonical correlation, Hotelling 1936). `paths`:
// light paths per camera; the `num_lights` brightest at each time count. Searches `reach` seconds in both directions.
// Offsets are relative to the camera with the most samples; returns its index.
size_t coarse_clocks(const std::vector<std::vector<LightPath>>& paths, const std::vector<double>& frame_times,
                     size_t num_lights, double reach, std::vector<CameraClock>& clocks);

struct ClockSample {
  double stamp = 0;    // seconds
  double seconds = 0;  // correction of the clock's offset
  double sigma = 0;    // seconds
};
// Refines a clock with all samples of its camera. The fit is robust, adds steps of whole frames if the samples require
// them, and adds a drift if it is significant. Corrections should be below a few frames. `shown`: the share of a wrong
// offset that no other parameter of the camera can absorb; scales the reported errors. Returns the change of the
// offset.
double refine_clock(CameraClock& clock, std::vector<ClockSample> samples, double frame_time, double shown);

// Returns the stamp of suspected frame drops that refine_clock() would not accept. A bundle adjustment with that step
// estimates the number of frames. Returns nullopt if no stamp stands out.
std::optional<double> suspected_step(std::vector<ClockSample> samples);

}  // namespace lf
