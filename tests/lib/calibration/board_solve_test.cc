// SPDX-License-Identifier: LGPL-2.1-or-later
#include "calibration/board_solve.h"

#include "calibration/diagnosis.h"
#include "calibration/placement.h"
#include "calibration/simulator.h"
#include "support/expect_error.h"
#include "support/test.h"

namespace lf {
namespace {

constexpr double kNoise = 0.1;  // pixels
const CalibrationBoard kBoard{.columns = 8, .rows = 5, .square = 0.03};

sim::PathOptions path(int positions) {
  sim::PathOptions options;
  options.board = kBoard;
  options.positions = positions, options.near = 0.35, options.far = 0.9, options.noise = kNoise;
  return options;
}

Rig array_of(int rows, int columns) {
  sim::ArrayOptions options;
  options.rows = rows, options.columns = columns;
  options.width = 640, options.height = 480, options.f = 700;
  return sim::make_array(options, 5);
}

BoardSightings sightings_of(const Rig& truth, int positions) {
  return sim::sightings_of(sim::watch(truth, path(positions), 6).tracks, kBoard);
}

// Returns the RMS distance of the cameras from the truth after alignment without scale, metres.
double position_error(const BoardSolution& solved, const Rig& truth) {
  std::vector<Pose> found, expected;
  for (size_t i = 0; i < truth.cameras.size(); i++) {
    if (!solved.solution.scene.cameras[i].used) continue;
    found.push_back(solved.solution.scene.cameras[i].pose());
    expected.push_back(truth.cameras[i].pose);
  }
  const Similarity s = align(found, expected, true);
  double sum = 0;
  for (size_t i = 0; i < found.size(); i++)
    sum += std::pow(glm::length(s(found[i]).position - expected[i].position), 2);
  return std::sqrt(sum / static_cast<double>(found.size()));
}

TEST(SolveBoards, FindsPosesLensesAndScale) {
  const Rig truth = array_of(2, 3);
  const BoardSolution solved = solve_boards(sightings_of(truth, 25), {});
  EXPECT_LT(position_error(solved, truth), 1e-3);
  EXPECT_NEAR(solved.solution.sigma, kNoise, 0.1 * kNoise);
  EXPECT_EQ(solved.solution.distortion.terms, 2) << solved.solution.distortion.name();
  for (size_t i = 0; i < truth.cameras.size(); i++)
    EXPECT_NEAR(solved.solution.scene.cameras[i].lens().fx(), truth.cameras[i].lens.fx(), 3) << i;
  const Placement placement = place_solution(solved.solution, solved.tracks, {}, {});
  EXPECT_EQ(placement.scale_from, "the board's size");
  EXPECT_DOUBLE_EQ(placement.world_from_scene.scale, 1);
}

// Different lenses in one rig, and cameras that look inward from all sides.
TEST(SolveBoards, CalibratesARingOfDifferentLenses) {
  Rig truth = sim::make_rig_around(sim::Around::kRing, 5, 3);
  for (size_t i = 0; i < truth.cameras.size(); i++) {
    const double f = 400 + 100.0 * static_cast<double>(i);
    truth.cameras[i].lens = Lens(LensModel::kRadial, {f, 320, 240, -0.05, 0.01});
  }
  // The front of the board is visible to cameras on one side only, so the board turns around.
  const CalibrationBoard board{.columns = 8, .rows = 5, .square = 0.12};
  BoardSightings sightings{board, {}, 60, {}};
  for (const Camera& camera : truth.cameras) sightings.cameras.push_back({camera.id, camera.width, camera.height});
  std::mt19937 random(7);
  std::normal_distribution<double> normal;
  for (uint32_t j = 0; j < sightings.num_instants; j++) {
    const double turn = 2 * M_PI * j / static_cast<double>(sightings.num_instants);
    const Pose board_pose = look_at(Vec3(0.2 * normal(random), 0.2 * normal(random), 0.2 * normal(random)),
                                    Vec3(-std::cos(turn), 0.5 * normal(random), -std::sin(turn)) * 10.0, Vec3(0, 1, 0));
    for (uint32_t i = 0; i < truth.cameras.size(); i++) {
      if (glm::dot(board_pose.forward(), glm::normalize(board_pose.position - truth.cameras[i].pose.position)) < 0.4)
        continue;
      BoardView view;
      for (size_t c = 0; c < board.num_corners(); c++) {
        const Camera& camera = truth.cameras[i];
        const auto pixel =
            camera.lens.project(camera.pose.camera_from_world(board_pose.world_from_camera(Vec3(board.corner(c), 0))));
        if (!pixel || pixel->x < 0 || pixel->y < 0 || pixel->x > 639 || pixel->y > 479) continue;
        view.ids.push_back(static_cast<int>(c));
        view.corners.push_back(*pixel + kNoise * Vec2(normal(random), normal(random)));
      }
      if (view.corners.size() >= 6) sightings.sightings.push_back({i, j, std::move(view)});
    }
  }
  const BoardSolution solved = solve_boards(sightings, {});
  for (const CameraState& camera : solved.solution.scene.cameras) EXPECT_TRUE(camera.used);
  EXPECT_LT(position_error(solved, truth), 0.01);
  for (size_t i = 0; i < truth.cameras.size(); i++)
    EXPECT_NEAR(solved.solution.scene.cameras[i].lens().fx() / truth.cameras[i].lens.fx(), 1, 0.01) << i;
}

// Fisheye lenses of 180 degrees are recognised. FULL_OPENCV comes from a prior rig; its further terms do not change.
TEST(SolveBoards, CalibratesGeneralLenses) {
  using enum LensModel;
  for (const Lens& lens : {Lens(kOpenCvFisheye, {200, 200, 321, 238, 0.02, -0.005, 0, 0}),
                           Lens(kFullOpenCv, {600, 600, 321, 238, -0.1, 0.02, 0, 0, 0.01, 0.1, 0, 0})}) {
    SCOPED_TRACE(lens_model_name(lens.model()));
    Rig truth = array_of(2, 3);
    for (Camera& camera : truth.cameras) camera.lens = lens;
    SolveOptions options;
    if (lens.model() == kFullOpenCv) {
      options.prior = truth;
      for (Camera& camera : options.prior->cameras) {
        auto params = lens.params();
        params[0] = params[1] = 606, params[2] += 3;
        camera.lens = Lens(kFullOpenCv, params);
      }
    }
    sim::PathOptions near = path(40);
    if (lens.model() == kOpenCvFisheye) near.near = 0.15, near.far = 0.5;
    const BoardSolution solved = solve_boards(sim::sightings_of(sim::watch(truth, near, 6).tracks, kBoard), options);
    EXPECT_LT(position_error(solved, truth), 2e-3);
    EXPECT_NEAR(solved.solution.sigma, kNoise, 0.1 * kNoise);
    for (const CameraState& camera : solved.solution.scene.cameras) {
      const Lens found = camera.lens();
      ASSERT_EQ(found.model(), lens.model());
      EXPECT_NEAR(found.fx(), lens.fx(), 0.01 * lens.fx());
      EXPECT_LT(glm::length(*found.project({0.3, 0.2, 1}) - *lens.project({0.3, 0.2, 1})), 1);
    }
  }
}

TEST(SolveBoards, WrongViewsAreOutliers) {
  const Rig truth = array_of(2, 2);
  BoardSightings sightings = sightings_of(truth, 25);
  size_t wrong = 0;
  for (size_t i = 3; i < sightings.sightings.size(); i += 17) {
    for (Vec2& corner : sightings.sightings[i].view.corners) corner += Vec2(9, -6);
    wrong += sightings.sightings[i].view.corners.size();
  }
  const BoardSolution solved = solve_boards(sightings, {});
  EXPECT_LT(position_error(solved, truth), 1e-3);
  const auto outliers = std::count(solved.solution.inliers.begin(), solved.solution.inliers.end(), 0);
  EXPECT_NEAR(static_cast<double>(outliers), static_cast<double>(wrong), 0.05 * static_cast<double>(wrong) + 20);
}

TEST(SolveBoards, MeasuredLensesArePriors) {
  const Rig truth = array_of(1, 3);
  SolveOptions options;
  sim::measure_lenses(truth, {.f = 0.01, .c = 0.01, .k1 = 1e-5, .k2 = 1e-5}, 8, options);
  const BoardSolution solved = solve_boards(sightings_of(truth, 6), options);
  EXPECT_LT(position_error(solved, truth), 1e-3);
  for (size_t i = 0; i < truth.cameras.size(); i++)
    EXPECT_NEAR(solved.solution.scene.cameras[i].lens().fx(), truth.cameras[i].lens.fx(), 0.1) << i;
}

TEST(SolveBoards, CamerasWithoutSharedViewsAreNamed) {
  const Rig truth = array_of(1, 4);
  BoardSightings sightings = sightings_of(truth, 30);
  // Cameras 0 and 1 see the first half, cameras 2 and 3 the second half; camera 1 sees more than camera 3.
  std::erase_if(sightings.sightings, [](const auto& s) { return (s.camera < 2) != (s.instant < 16); });
  const BoardSolution solved = solve_boards(sightings, {});
  const auto& cameras = solved.solution.scene.cameras;
  EXPECT_EQ(std::count_if(cameras.begin(), cameras.end(), [](const auto& c) { return c.used; }), 2);
  const Placement placement = place_solution(solved.solution, solved.tracks, {}, {});
  std::string texts;
  for (const Finding& finding : diagnose(solved.solution, solved.tracks, {}, placement)) texts += finding.text + "\n";
  EXPECT_MENTIONS(texts, "never see the board at the same time", "{0 1}", "{2 3}");
}

TEST(SolveBoards, ImpossibleInputIsAnError) {
  const Rig truth = array_of(1, 2);
  BoardSightings sightings = sightings_of(truth, 12);
  BoardSightings alternating = sightings;
  std::erase_if(alternating.sightings, [](const auto& s) { return s.camera != s.instant % 2; });
  EXPECT_ERROR(solve_boards(alternating, {}), "no two cameras", "same instant");
  BoardSightings few = sightings;
  std::erase_if(few.sightings, [](const auto& s) { return s.instant > 2; });
  EXPECT_ERROR(solve_boards(few, {}), "enough views", "tilt the board");
  sightings.board.columns = 7;
  EXPECT_ERROR(solve_boards(sightings, {}), "7x5", "half a turn", "ChArUco");
}

}  // namespace
}  // namespace lf
