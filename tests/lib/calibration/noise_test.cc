// SPDX-License-Identifier: LGPL-2.1-or-later
#include "calibration/noise.h"
#include "calibration/simulator.h"
#include "support/test.h"

namespace lf {
namespace {

TEST(RobustScale, SigmaToleratesOutliers) {
  std::mt19937 random(1);
  std::normal_distribution<double> normal(0, 0.25);
  std::vector<double> lengths;
  for (int i = 0; i < 20000; i++) lengths.push_back(std::hypot(normal(random), normal(random)));
  EXPECT_NEAR(robust_sigma(lengths), 0.25, 0.005);
  for (int i = 0; i < 2000; i++) lengths.push_back(100);
  for (int i = 0; i < 2000; i++) lengths.push_back(-1);
  EXPECT_NEAR(robust_sigma(lengths), 0.25, 0.03);
  EXPECT_EQ(robust_sigma({}), 0);
}

TEST(RobustScale, ObservationsWithoutResidualAreNoInliers) {
  EXPECT_EQ(within({-1, 0, 0.5, 0.7}, 3, 0.2), (Inliers{0, 1, 1, 0}));
}

double disagreement(bool alike) {
  const Rig truth = sim::make_array({.rows = 4, .columns = 4}, 1);
  sim::Watched watched = sim::watch(truth, {.positions = 400}, 2);
  watched.tracks.ordered = false;
  if (alike) {
    // One camera's errors on the features of one object are equal.
    std::mt19937 random(3);
    std::normal_distribution<double> normal(0, 0.5);
    std::map<std::array<int, 3>, Vec2> common;
    std::map<uint32_t, Vec2> first;
    for (Observation& o : watched.tracks.observations) {
      const Vec2 at = first.try_emplace(o.position, o.pixel).first->second / 40.0;
      const auto [off, added] =
          common.try_emplace({static_cast<int>(o.camera), static_cast<int>(at.x), static_cast<int>(at.y)});
      if (added) off->second = Vec2(normal(random), normal(random));
      o.pixel += off->second;
    }
  }
  SolveOptions options;
  sim::measure_lenses(truth, {}, 4, options);
  options.distortion = DistortionModel{2, false};
  const Solution solution = solve_tracks(watched.tracks, options);
  AdjustmentOptions model = solution.model;
  model.sigma = solution.sigma;  // before it was enlarged by the effect measured here
  return disagreement_of_halves(solution.scene, watched.tracks, solution.inliers, model);
}

TEST(DisagreementOfHalves, GrowsIfErrorsAreCorrelated) {
  EXPECT_NEAR(disagreement(false), 1, 0.3);
  EXPECT_GT(disagreement(true), 1.35);
}

TEST(TrackNoise, EachTrackHasItsOwnNoise) {
  const Rig truth = sim::make_array({}, 1);
  sim::Watched watched = sim::watch(truth, {.noise = 0.1}, 2);
  std::mt19937 random(3);
  std::normal_distribution<double> more(0, 0.5);
  for (Observation& o : watched.tracks.observations)
    if (o.position % 5 == 0) o.pixel += Vec2(more(random), more(random));
  estimate_track_noise(sim::true_scene(truth, watched, {}), watched.tracks);
  for (const Observation& o : watched.tracks.observations)
    EXPECT_NEAR(o.sigma, o.position % 5 ? 1 : 5.1, o.position % 5 ? 0.3 : 1.5) << o.position;
}

TEST(TrackNoise, OutlierDoesNotAffectItsTrack) {
  const Rig truth = sim::make_array({}, 1);
  sim::Watched watched = sim::watch(truth, {}, 2);
  for (Observation& o : watched.tracks.observations)
    if (o.camera == 9) o.pixel.x += 20;
  estimate_track_noise(sim::true_scene(truth, watched, {}), watched.tracks);
  for (const Observation& o : watched.tracks.observations) EXPECT_NEAR(o.sigma, 1, 0.3) << o.position;
}

}  // namespace
}  // namespace lf
