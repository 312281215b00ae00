// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstddef>
#include <span>
#include <vector>

namespace lf {

// How evenly a camera takes its frames, from the times that they were taken at. Seconds.
struct FrameTimes {
  size_t frames = 0;
  double period = 0;     // seconds from frame to frame on the line through all times; 0: fewer than three frames
  double first = 0;      // time of the first frame on that line
  double jitter = 0;     // rms of the times about the line: how far stamps can be believed
  size_t missing = 0;    // frames that the line has and that did not come
  size_t backwards = 0;  // times that are not after the one before; the line is through the others

  double rate() const { return period > 0 ? 1 / period : 0; }
};

// `times`: in the order that frames came in.
FrameTimes measure_frame_times(std::span<const double> times);

// How cameras that run at one rate stand to each other.
struct Skew {
  std::vector<double>
      phase;  // for each camera the seconds that it is behind the others' middle: at most half a period; NAN: not known
  double spread = 0;  // seconds between the two cameras farthest apart
  double drift = 0;   // relative rate by which the fastest camera's clock leads the slowest's
};

// Cameras whose period differs by more than 1 % from the median one are left out: their phase is NAN.
Skew measure_skew(std::span<const FrameTimes> cameras);

}  // namespace lf
