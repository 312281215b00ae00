// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include <lightfield/calibration.h>
#include <Eigen/Core>
#include <nlohmann/json_fwd.hpp>

#include "calibration/light_detector.h"

namespace lf {

// How the stamps of a camera's frames relate to the true capture times on the common clock of all cameras: true time =
// stamp + offset, like `time_offset` in a rig.
struct CameraClock {
  // Frames that the camera dropped without leaving a gap between the stamps, so that all later stamps are too early.
  struct Step {
    double stamp = 0;    // stamp of the first frame after the dropped frames
    double seconds = 0;  // how much later than their stamps the following frames were captured
    int frames = 0;
  };
  double offset = 0;  // seconds, before the first step
  double sigma = 0;   // standard deviation of the offset, seconds
  double drift = 0;   // seconds per second, relative to the stamp `middle`
  double middle = 0;  // a stamp, seconds
  std::vector<Step> steps;
  bool known = false;  // false if the light motion in this camera does not match that in other cameras

  double true_time(double stamp) const;
  double stamp_of(double true_time) const;
};

// The motion in the images of one camera, at multiples of kStep on the camera's clock.
struct CameraMotion {
  static constexpr double kStep = 1.0 / 30;  // seconds
  int64_t first = 0;                         // time of the first velocity, in steps
  std::vector<Eigen::Matrix<double, 6, 1>> velocity;
  std::vector<char> known;
  size_t count = 0;  // of known velocities
};
struct MotionMatch {
  double score = 0;   // log likelihood ratio of a common motion and of independent motions; 0: no common motion
  double offset = 0;  // second camera minus first camera, seconds
};
// Finds the best offset of at most `reach` seconds. The velocities of both cameras are equal if `same_axes` is true.
// Otherwise only their first two elements count, which are approximately linear functions of each other (canonical
// correlation, Hotelling 1936).
MotionMatch match_motions(const CameraMotion& a, const CameraMotion& b, double reach, bool same_axes);

// Estimates clock offsets to about a quarter of a frame, without knowing the cameras' positions.
//
// `paths` has the light paths of each camera. The `num_lights` brightest paths at each time count. Offsets of up to
// `reach` seconds in both directions are tried. The result is relative to the camera with the most samples; the
// function returns its index.
size_t coarse_clocks(const std::vector<std::vector<LightPath>>& paths, const std::vector<double>& frame_times,
                     size_t num_lights, double reach, std::vector<CameraClock>& clocks);

struct ClockSample {
  double stamp = 0;    // seconds
  double seconds = 0;  // correction of the clock's offset
  double sigma = 0;    // seconds
};
// Refines a clock with all samples of its camera. The fit is robust. It adds steps of whole frames if the samples
// require them, and a drift if that is significant. Corrections should be smaller than a few frames. `shown` is the
// share of a wrong offset that no other parameter of the camera can absorb; the errors of the result are scaled
// accordingly. Returns the change of the offset.
double refine_clock(CameraClock& clock, std::vector<ClockSample> samples, double frame_time, double shown);

// Returns what the user should know of the clock of camera `id`: dropped frames, a drift that matters in a recording of
// `seconds`, and an offset that is far from `expected`, in seconds.
std::vector<lightfield::Finding> diagnose_clock(unsigned id, const CameraClock& clock, double seconds, double expected);

// Adds members to a camera of a calibration_report(): "time_offset_ms", "time_offset_sigma_ms", "clock_drift_ppm", and
// "dropped_frames" (a list of {"stamp", "frames"}). Adds nothing if the clock is not known.
void add_clock(const CameraClock& clock, nlohmann::ordered_json& camera);

// Returns the stamp of a suspected frame drop, although the evidence is too weak for refine_clock(). Returns nullopt if
// no stamp stands out.
std::optional<double> suspected_step(std::vector<ClockSample> samples);

}  // namespace lf
