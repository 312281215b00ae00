// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <optional>
#include <vector>

#include "calibration/light_sights.h"

namespace lf {

// A light, or a reflection of one, followed through the frames of one camera.
struct LightPath {
  struct Point {
    double time = 0;  // the camera's stamp
    Sight sight;
  };
  std::vector<Point> points;  // points in the order of time, two at least
  double brightness = 0;      // median brightness of its points
  bool still = false;         // a lamp, or what has only been switched on: no light that is moved
};

// All paths in one camera's frames, at evened_stamps(). Sights that nothing continues are left out.
std::vector<LightPath> link_light_paths(const LightSights::Camera& camera);

// The place of a path between its points: on the cubic through the four around.
struct PathPlace {
  Vec2 pixel{0, 0};
  Vec2 velocity{0, 0};    // pixels a second
  double sigma = 0;       // standard deviation of the place, from those of the points around
  double brightness = 0;  // brightness of the nearest point
};
// The place at a stamp; nothing outside of the path, and in gaps of more than kMostMissed frames.
std::optional<PathPlace> place_at(const LightPath& path, double time, double frame_time);

inline constexpr int kMostMissed = 2;

// The frames' stamps as an even rhythm has them, frames missing here and there, where they are that but for a jitter:
// files round stamps to a millisecond, in which a light goes half a millimetre; and drivers stamp what has arrived. As
// they are where there is no such rhythm.
std::vector<double> evened_stamps(const LightSights::Camera& camera);

// Seconds from frame to frame, the median; 0 where there are fewer than two.
double frame_time_of(const LightSights::Camera& camera);

}  // namespace lf
