// SPDX-License-Identifier: LGPL-2.1-or-later
#include "calibration/moving_light.h"

#include <nlohmann/json.hpp>

#include "calibration/simulator.h"
#include "scene/calibration_targets.h"
#include "support/expect_error.h"
#include "support/test.h"

namespace lf {
namespace {

using testing::Field;

constexpr double kNoise = 0.03;  // pixels

struct Recorded {
  Rig truth;
  MovingLightOptions lights;
  LightDetections sights;
};

struct Recording {
  double bar = 0.3, reflection = 0;
  bool dropped = false;
  double late = 0;  // camera 2, seconds
  double seconds = 8;
  double drift = 0;   // camera 3, seconds per second
  uint64_t seed = 3;  // seed of the array: this plus 2
};

// Nine cameras with 30 and 15 frames per second in turn and different phases; some recordings are shorter.
Recorded record(const Recording& how) {
  Recorded r{sim::make_array({.rows = 3, .columns = 3}, how.seed + 2), {}, {}};
  r.lights.bar = how.bar, r.lights.reflection = how.reflection;
  r.sights.bar = how.bar > 0;
  const LightTrajectory path(r.truth, r.lights);
  std::mt19937_64 random(how.seed);
  std::normal_distribution<double> normal(0, kNoise);
  std::uniform_real_distribution<double> uniform(-0.033, 0.033);
  for (size_t i = 0; i < r.truth.cameras.size(); i++) {
    Camera& camera = r.truth.cameras[i];
    camera.time_offset = uniform(random) + (i == 2 ? how.late : 0);
    const MovingLightCamera lights(path, {camera.width, camera.height, camera.lens, camera.pose});
    LightDetections::Camera& seen = r.sights.cameras.emplace_back();
    seen = {camera.id, camera.width, camera.height, {}};
    const double rate = i % 2 ? 15 : 30;
    const auto frames = static_cast<int>((how.seconds - 0.5 * static_cast<double>(i % 3)) * rate);
    for (int n = 0; n < frames; n++) {
      const double stamp = n / rate, lost = how.dropped && i == 4 && n >= frames / 2 ? 1 / rate : 0;
      LightDetections::Frame& frame = seen.frames.emplace_back();
      frame.time = std::round(stamp * 1000) / 1000;  // Matroska's millisecond resolution
      const double drifted = i == 3 ? how.drift * stamp : 0;
      const auto places = lights.places(stamp + camera.time_offset + lost + drifted);
      for (size_t k = 0; k < places.size(); k++)
        if (places[k])
          frame.sights.push_back({*places[k] + Vec2(normal(random), normal(random)), kNoise,
                                  k < static_cast<size_t>(path.num_lights()) ? 1000.0 : 300.0});
    }
  }
  return r;
}

// Returns the root mean square error of the clock offsets, up to a common offset.
double offset_error(const Recorded& r, const LightSolution& solution) {
  double sum = 0, squares = 0;
  const auto n = static_cast<double>(solution.clocks.size());
  for (size_t i = 0; i < solution.clocks.size(); i++) {
    const double e = solution.clocks[i].offset - r.truth.cameras[i].time_offset;
    sum += e, squares += e * e;
  }
  return std::sqrt(std::max(0.0, squares / n - sum * sum / (n * n)));
}

double position_error(const Recorded& r, const LightSolution& solution) {
  std::vector<Pose> found, expected;
  for (size_t i = 0; i < r.truth.cameras.size(); i++) {
    EXPECT_TRUE(solution.solution.scene.cameras[i].used) << i;
    found.push_back(solution.solution.scene.cameras[i].pose()), expected.push_back(r.truth.cameras[i].pose);
  }
  const Similarity s = align(found, expected);
  double sum = 0;
  for (size_t i = 0; i < found.size(); i++) {
    const Vec3 e = s(found[i]).position - expected[i].position;
    sum += glm::dot(e, e);
  }
  return std::sqrt(sum / static_cast<double>(found.size()));
}

// Counts observations farther than a pixel from the light's image at their time.
size_t mistaken(const Recorded& r, const LightSolution& solution) {
  const LightTrajectory path(r.truth, r.lights);
  double shift = 0;  // clock of the truth to clock of the solution
  for (size_t i = 0; i < solution.clocks.size(); i++)
    shift += (r.truth.cameras[i].time_offset - solution.clocks[i].offset) / static_cast<double>(solution.clocks.size());
  size_t wrong = 0;
  for (const Observation& o : solution.tracks.observations) {
    const Camera& camera = r.truth.cameras[o.camera];
    bool light = false;
    for (const Vec3& at : path.lights(solution.instants[o.position] + shift))
      if (const auto pixel = camera.lens.project(camera.pose.camera_from_world(at)))
        light |= glm::length(*pixel - o.pixel) < 1;
    wrong += !light;
  }
  return wrong;
}

TEST(MovingLight, EstimatesClockOffsets) {
  const Recorded r = record({});
  const LightSolution solution = solve_lights(r.sights, {});
  EXPECT_LE(offset_error(r, solution), 1e-4);
  EXPECT_LE(position_error(r, solution), 5e-4);
  EXPECT_EQ(mistaken(r, solution), 0u);
  EXPECT_GT(solution.tracks.observations.size(), 1500u);
  for (const CameraClock& clock : solution.clocks) {
    EXPECT_TRUE(clock.known);
    EXPECT_TRUE(clock.steps.empty());
    EXPECT_LT(clock.sigma, 1e-4);
  }
  EXPECT_TRUE(diagnose_clocks(solution).empty());
  nlohmann::ordered_json report = {{"cameras", nlohmann::ordered_json::array()}};
  add_clocks(solution, report);
  EXPECT_EQ(report["cameras"].size(), 9u);
  EXPECT_NEAR(report["cameras"][3]["time_offset_ms"].get<double>(), 1e3 * solution.clocks[3].offset, 1e-9);
}

TEST(MovingLight, RejectsReflections) {
  const Recorded r = record({.reflection = 0.5});
  const LightSolution solution = solve_lights(r.sights, {});
  EXPECT_EQ(mistaken(r, solution), 0u);
  EXPECT_LE(offset_error(r, solution), 2e-4);
  EXPECT_LE(position_error(r, solution), 5e-4);
  for (const size_t reflections : solution.reflections) EXPECT_GT(reflections, 50u);
}

TEST(MovingLight, FindsADroppedFrame) {
  const Recorded r = record({.dropped = true});
  const LightSolution solution = solve_lights(r.sights, {});
  EXPECT_LE(offset_error(r, solution), 2e-4);
  ASSERT_EQ(solution.clocks[4].steps.size(), 1u);
  EXPECT_EQ(solution.clocks[4].steps[0].frames, 1);
  EXPECT_NEAR(solution.clocks[4].steps[0].stamp, 3.75, 0.15);
  EXPECT_THAT(diagnose_clocks(solution),
              ElementsAre(AllOf(Field(&Finding::code, "dropped-frames"),
                                Field(&Finding::text, mentions("camera 4", "1 frame", "at 3.")))));
}

TEST(MovingLight, AcceptsALateRecording) {
  const Recorded r = record({.late = 1.3});
  const LightSolution solution = solve_lights(r.sights, {});
  EXPECT_LE(offset_error(r, solution), 2e-4);
  EXPECT_THAT(diagnose_clocks(solution), ElementsAre(Field(&Finding::code, "late-camera")));
}

LightSolution solve_one_light(const Recorded& r) {
  LightSolveOptions options;
  sim::measure_lenses(r.truth, {}, 4, options.solve);
  return solve_lights(r.sights, options);
}

// A camera's pose can absorb much of its clock error: both must be estimated together.
TEST(MovingLight, OneLightDeterminesTheClocks) {
  for (const uint64_t seed : {3, 11, 12}) {
    const Recorded r = record({.bar = 0, .seed = seed});
    const LightSolution solution = solve_one_light(r);
    std::printf("one light, seed %d: offsets %.3f ms\n", static_cast<int>(seed), 1e3 * offset_error(r, solution));
    EXPECT_LE(offset_error(r, solution), 5e-4) << seed;
    for (const CameraClock& clock : solution.clocks) EXPECT_TRUE(clock.steps.empty()) << seed;
  }
}

TEST(MovingLight, OneLightRevealsADroppedFrame) {
  for (const uint64_t seed : {3, 11, 12, 13}) {
    const Recorded r = record({.bar = 0, .dropped = true, .seed = seed});
    const LightSolution solution = solve_one_light(r);
    ASSERT_EQ(solution.clocks[4].steps.size(), 1u) << seed;
    EXPECT_EQ(solution.clocks[4].steps[0].frames, 1) << seed;
    EXPECT_NEAR(solution.clocks[4].steps[0].stamp, 3.75, 0.2) << seed;
  }
}

TEST(MovingLight, EstimatesClockDrift) {
  for (const double bar : {0.3, 0.0}) {
    const Recorded r = record({.bar = bar, .drift = 5e-4});
    const LightSolution solution = bar > 0 ? solve_lights(r.sights, {}) : solve_one_light(r);
    EXPECT_NEAR(solution.clocks[3].drift, 5e-4, 5e-5) << bar;
    EXPECT_TRUE(solution.clocks[3].steps.empty()) << bar;
    for (size_t i = 0; i < 9; i++)
      EXPECT_TRUE(i == 3 || std::abs(solution.clocks[i].drift) < 1e-4) << bar << ", camera " << i;
  }
}

TEST(MovingLight, RejectsReflectionsOfOneLight) {
  const Recorded r = record({.bar = 0, .reflection = 0.5});
  EXPECT_EQ(mistaken(r, solve_one_light(r)), 0u);
}

TEST(MovingLight, StaticLightsAreAnError) {
  Recorded r = record({});
  for (LightDetections::Camera& camera : r.sights.cameras)
    for (LightDetections::Frame& frame : camera.frames) frame.sights.clear();
  EXPECT_ERROR(solve_lights(r.sights, {}), "no camera", "light");
}

}  // namespace
}  // namespace lf
