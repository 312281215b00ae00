// SPDX-License-Identifier: LGPL-2.1-or-later
#include "calibration/noise.h"

#include <random>

#include <gtest/gtest.h>

#include "calibration/simulator.h"

namespace lf {
namespace {

TEST(TrackNoise, EachTrackHasItsOwn) {
  const Rig truth = sim::make_array({}, 1);
  sim::PathOptions path;
  path.noise = 0.1;
  sim::Watched watched = sim::watch(truth, path, 2);
  std::mt19937 random(3);
  std::normal_distribution<double> more(0, 0.5);
  for (Observation& o : watched.tracks.observations)
    if (o.position % 5 == 0) o.pixel += Vec2(more(random), more(random));
  estimate_track_noise(sim::true_scene(truth, watched, {}), watched.tracks);
  for (const Observation& o : watched.tracks.observations) {
    if (o.position % 5 == 0)
      EXPECT_NEAR(o.sigma, 5.1, 1.5) << o.position;
    else
      EXPECT_NEAR(o.sigma, 1, 0.3) << o.position;
  }
}

TEST(TrackNoise, AWildSightDoesNotSpoilItsTrack) {
  const Rig truth = sim::make_array({}, 1);
  sim::Watched watched = sim::watch(truth, {}, 2);
  for (Observation& o : watched.tracks.observations)
    if (o.camera == 9) o.pixel.x += 20;
  estimate_track_noise(sim::true_scene(truth, watched, {}), watched.tracks);
  for (const Observation& o : watched.tracks.observations) EXPECT_NEAR(o.sigma, 1, 0.3) << o.position;
}

}  // namespace
}  // namespace lf
