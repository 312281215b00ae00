// SPDX-License-Identifier: LGPL-2.1-or-later
#include "calibration/board_motion.h"

#include <nlohmann/json.hpp>

#include "calibration/simulator.h"
#include "support/test.h"

namespace lf {
namespace {

constexpr double kNoise = 0.1;  // pixels

struct Scene {
  Rig truth;
  sim::MovingBoard motion;
  BoardFilms films;
};

Scene film(int rows, int columns, sim::MovingBoard motion) {
  Scene scene{
      sim::make_array({.rows = rows, .columns = columns, .f = 700, .width = 640, .height = 480}, 5), motion, {}};
  scene.films = sim::film_board(scene.truth, scene.motion, 7);
  return scene;
}

// Returns the RMS of values minus their median.
double scatter(const std::vector<double>& values) {
  const double middle = median(values);
  double sum = 0;
  for (const double v : values) sum += (v - middle) * (v - middle);
  return std::sqrt(sum / static_cast<double>(values.size()));
}

double clock_error(const Scene& scene, const std::vector<CameraClock>& clocks) {
  std::vector<double> errors;
  for (size_t i = 0; i < clocks.size(); i++) {
    EXPECT_TRUE(clocks[i].known) << i;
    errors.push_back(clocks[i].offset - scene.truth.cameras[i].time_offset);
  }
  return scatter(errors);
}

double position_error(const Scene& scene, const Solution& solution) {
  std::vector<Pose> found, expected;
  for (size_t i = 0; i < scene.truth.cameras.size(); i++) {
    EXPECT_TRUE(solution.scene.cameras[i].used) << i;
    found.push_back(solution.scene.cameras[i].pose());
    expected.push_back(scene.truth.cameras[i].pose);
  }
  const Similarity s = align(found, expected, true);
  double worst = 0;
  for (size_t i = 0; i < found.size(); i++)
    worst = std::max(worst, glm::length(s(found[i]).position - expected[i].position));
  return worst;
}

std::vector<CameraClock> common_clock(size_t cameras) {
  std::vector<CameraClock> clocks(cameras);
  for (CameraClock& clock : clocks) clock.known = true;
  return clocks;
}

MovingBoardSolution solve(const Scene& scene) {
  return solve_moving_board(scene.films, scene.motion.instants(), common_clock(scene.truth.cameras.size()), {});
}

std::string texts(const MovingBoardSolution& solved) {
  std::string all;
  for (const Finding& finding : diagnose_times(solved)) all += finding.code + ": " + finding.text + "\n";
  return all;
}

// Free-running cameras with global shutters.
TEST(MovingBoard, EstimatesOffsets) {
  const Scene scene = film(2, 2, {.noise = kNoise, .offset = 0.02});
  const MovingBoardSolution solved = solve(scene);
  EXPECT_LT(clock_error(scene, solved.clocks), 2e-4);
  EXPECT_LT(position_error(scene, solved.solution), 1e-3);
  for (size_t i = 0; i < solved.clocks.size(); i++) {
    EXPECT_LT(solved.clocks[i].sigma, 3e-4) << i;
    EXPECT_EQ(solved.shutters[i].readout, 0) << i;
    EXPECT_EQ(solved.clocks[i].drift, 0) << i;
    EXPECT_LT(solved.shutters[i].sigma, 2e-3) << i;
  }
  EXPECT_EQ(texts(solved), "");
}

TEST(MovingBoard, EstimatesRollingShutters) {
  const Scene scene = film(2, 2, {.noise = kNoise, .offset = 0.01, .readout = 0.025});
  const MovingBoardSolution solved = solve(scene);
  EXPECT_LT(clock_error(scene, solved.clocks), 2e-4);
  EXPECT_LT(position_error(scene, solved.solution), 1e-3);
  for (size_t i = 0; i < solved.shutters.size(); i++) {
    EXPECT_NEAR(solved.shutters[i].readout, 0.025, 5 * solved.shutters[i].sigma + 2e-4) << i;
    EXPECT_GT(solved.shutters[i].shift, 0.2) << i;
  }
  EXPECT_MENTIONS(texts(solved), "rolling-shutter", "camera 3", "is corrected");
  nlohmann::ordered_json report = {{"cameras", nlohmann::ordered_json::array({{}, {}, {}, {}})}};
  add_times(solved, report);
  EXPECT_NEAR(report["cameras"][2]["readout_ms"].get<double>(), 25, 2);
  EXPECT_GT(report["cameras"][2]["readout_sigma_ms"].get<double>(), 0);
  EXPECT_GT(report["cameras"][2]["rolling_shutter_px"].get<double>(), 0.2);
  EXPECT_LT(report["cameras"][2]["time_offset_sigma_ms"].get<double>(), 0.5);
}

// Few noisy views leave a readout time unknown that would be noticeable.
TEST(MovingBoard, TellsWhichReadoutTimesAreUnknown) {
  const Scene scene = film(2, 2, {.positions = 4, .noise = 1, .readout = 0.005});
  const MovingBoardSolution solved = solve(scene);
  for (size_t i = 0; i < solved.shutters.size(); i++) {
    EXPECT_EQ(solved.shutters[i].readout, 0) << i;
    EXPECT_EQ(solved.shutters[i].shift, 0) << i;
    EXPECT_GT(solved.shutters[i].sigma, 0.005 / 5) << i;
  }
  EXPECT_MENTIONS(texts(solved), "readout-unknown", "camera 3", "not corrected");
}

TEST(MovingBoard, EstimatesDrifts) {
  Scene scene = film(2, 2, {.noise = kNoise, .drift = 5e-4});
  const MovingBoardSolution solved = solve(scene);
  EXPECT_LT(position_error(scene, solved.solution), 1e-3);
  EXPECT_NEAR(solved.clocks[1].drift - solved.clocks[0].drift, 5e-4, 1e-4);
  EXPECT_MENTIONS(texts(solved), "clock-drift");
}

// Recordings that start at different times.
TEST(MovingBoard, FindsStartsOfRecordings) {
  const Scene scene = film(2, 2, {.noise = kNoise, .offset = 4, .rate = 12, .every_frame = true});
  const std::vector<CameraClock> clocks = coarse_board_clocks(scene.films, 10, {});
  EXPECT_LT(clock_error(scene, clocks), 0.02);
}

TEST(MovingBoard, StillBoardsTellNoTimes) {
  const Scene scene = film(2, 2, {.noise = kNoise, .offset = 0.01, .speed = 0});
  const MovingBoardSolution solved = solve(scene);
  EXPECT_LT(position_error(scene, solved.solution), 1e-3);
  for (size_t i = 0; i < solved.clocks.size(); i++) {
    EXPECT_FALSE(solved.clocks[i].known) << i;
    EXPECT_EQ(solved.shutters[i].readout, 0) << i;
  }
  EXPECT_EQ(texts(solved), "");
}

}  // namespace
}  // namespace lf
