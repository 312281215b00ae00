// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <optional>
#include <vector>

#include "calibration/light_detector.h"

namespace lf {

// What a camera's stamps say of the true time of capture, as far as all cameras have the same: true time = stamp +
// offset, as `time_offset` in a rig has it.
struct CameraClock {
  // Frames that came to nothing without leaving a gap between the stamps.
  struct Step {
    double stamp = 0;    // stamp of the first frame after those that were lost
    double seconds = 0;  // by so much frames from there on are later than their stamps say
    int frames = 0;
  };
  double offset = 0;  // seconds, before the first step
  double sigma = 0;   // standard deviation of the offset, seconds
  double drift = 0;   // seconds a second, about `middle`
  double middle = 0;  // the stamp in the middle of the recording
  std::vector<Step> steps;
  bool known = false;  // the camera saw a light move as others did

  double true_time(double stamp) const;
  double stamp_of(double true_time) const;
};

// Offsets to about a quarter of a frame without any geometry: the lights' velocities in two cameras' pictures are
// linear in each other, about, where the clocks agree (canonical correlation, Hotelling 1936). `paths`: of each camera,
// `num_lights` of which are taken to be the brightest at any time. Looks up to `reach` seconds to both sides. Relative
// to the camera that saw most, whose index is returned.
size_t coarse_clocks(const std::vector<std::vector<LightPath>>& paths, const std::vector<double>& frame_times,
                     size_t num_lights, double reach, std::vector<CameraClock>& clocks);

// How far a camera's clock is off at one place of a light.
struct ClockSample {
  double stamp = 0;    // seconds
  double seconds = 0;  // what is to be added to the clock's offset
  double sigma = 0;    // seconds
};
// Improves a clock by all samples of its camera: robust, with steps of whole frames where the samples call for it, and
// a drift where it is far beyond its error. What it changes should be below a few frames. `shown`: the share of a wrong
// offset that no other parameter of the camera could make up for; it tells the errors. Returns what it added to the
// offset.
double improve_clock(CameraClock& clock, std::vector<ClockSample> samples, double frame_time, double shown);

// The stamp at which frames seem to have been lost, by less than improve_clock() wants: how many, an adjustment with
// that step tells. Nothing where no stamp stands out.
std::optional<double> suspected_step(std::vector<ClockSample> samples);

}  // namespace lf
