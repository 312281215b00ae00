// SPDX-License-Identifier: LGPL-2.1-or-later
// Each finding is reported for its fault and only for that fault (see also the table of hard cases).
#include "calibration/diagnosis.h"
#include "calibration/simulator.h"
#include "support/test.h"

namespace lf {
namespace {

class DiagnosisTest : public testing::Test {
 protected:
  std::vector<Finding> findings() {
    const Solution solution = solve_tracks(watched_.tracks, options_);
    return diagnose(solution, watched_.tracks, options_,
                    place_solution(solution, watched_.tracks, options_, placement_));
  }
  std::string all_findings() {
    std::string all;
    for (const Finding& f : findings()) all += f.code + ": " + f.text + "\n";
    return all;
  }
  std::vector<std::string> codes() {
    std::vector<std::string> list;
    for (const Finding& f : findings())
      if (f.severity != Finding::Severity::kNote) list.push_back(f.code);
    return list;
  }
  Rig truth_ = sim::make_array({.rows = 4, .columns = 4}, 1);
  sim::Watched watched_ = sim::watch(truth_, {.bar = 0.3}, 2);
  SolveOptions options_{.distortion = DistortionModel{2, true}};
  PlacementOptions placement_{.bar_length = 0.3};
};

TEST_F(DiagnosisTest, GoodBarHasNoFindings) {
  const auto found = codes();
  for (const char* code : {"dead-camera", "camera-not-found", "late-camera", "many-outliers", "disconnected-groups",
                           "swapped-cameras", "soft-positions", "no-scale", "odd-scale", "prior-contradicted"})
    EXPECT_THAT(found, Not(Contains(code)));
}

TEST_F(DiagnosisTest, LateCameraIsNamedWithItsDelay) {
  for (Observation& o : watched_.tracks.observations)
    if (o.camera == 6) o.position += 2;
  std::erase_if(watched_.tracks.observations,
                [&](const Observation& o) { return o.position >= watched_.tracks.num_positions; });
  EXPECT_THAT(all_findings(), mentions("late-camera", "camera 6", "2 frames"));
  watched_.tracks.ordered = false;  // features have no frames
  EXPECT_THAT(codes(), Not(Contains("late-camera")));
}

TEST_F(DiagnosisTest, MissingOrOddScaleIsReported) {
  placement_.bar_length = 0;
  EXPECT_THAT(codes(), Contains("no-scale"));
  placement_.bar_length = 300;
  EXPECT_THAT(codes(), Contains("odd-scale"));
}

TEST_F(DiagnosisTest, ContradictedPriorIsReported) {
  sim::measure_lenses(truth_, {}, 3, options_);
  options_.distortion.reset();
  EXPECT_THAT(codes(), Not(Contains("prior-contradicted")));
  for (Camera& camera : options_.prior->cameras) {
    auto params = camera.lens.params();
    params[kF] *= 1.05;
    camera.lens = Lens(LensModel::kRadial, params);
  }
  EXPECT_THAT(codes(), Contains("prior-contradicted"));
}

TEST_F(DiagnosisTest, OneLightLeavesTheDepthUncertain) {
  placement_.bar_length = 0, placement_.pitch = 0.06;
  truth_ = sim::make_array({.rows = 4, .columns = 4, .position_jitter = 0, .pointing_jitter = 0}, 1);
  watched_ = sim::watch(truth_, {}, 2);
  EXPECT_THAT(codes(), Contains("soft-depth"));
}

// The positions of cameras in a row leave only the roll about the row unknown.
TEST_F(DiagnosisTest, RowOfCamerasNamesTheRoll) {
  truth_ = sim::make_array({.rows = 1, .columns = 4, .position_jitter = 0.002}, 1);
  watched_ = sim::watch(truth_, {.bar = 0.3}, 2);
  options_.distortion = DistortionModel{0, false};
  EXPECT_THAT(codes(), Not(Contains("soft-rotations")));
  EXPECT_THAT(all_findings(), mentions("unknown-roll", "in a row", "about its own axis"));
}

TEST_F(DiagnosisTest, WrongOrderIsNamedWithARemedy) {
  options_.prior = sim::make_array({.rows = 4, .columns = 4, .position_jitter = 0, .pointing_jitter = 0}, 1);
  placement_.bar_length = 0;  // scale comes from the layout, which swapped cameras must not change
  // A cycle of three cameras and a swapped pair: camera 1 is at position 2, 2 at 7, 7 at 1; 12 at 15, 15 at 12.
  const std::map<uint32_t, uint32_t> called{{2, 1}, {7, 2}, {1, 7}, {15, 12}, {12, 15}};
  for (Tracks::Camera& camera : watched_.tracks.cameras)
    if (const auto other = called.find(camera.id); other != called.end()) camera.id = other->second;
  const Solution solution = solve_tracks(watched_.tracks, options_);
  const Placement placement = place_solution(solution, watched_.tracks, options_, placement_);
  std::string all;
  for (const Finding& f : diagnose(solution, watched_.tracks, options_, placement)) all += f.text + "\n";
  EXPECT_THAT(all, mentions("1 at 2", "2 at 7", "7 at 1"));
  EXPECT_THAT(all, mentions("12", "15", "swapped"));
  const Rig rig = make_rig(solution, watched_.tracks, options_, placement);
  std::vector<uint32_t> order;
  for (const Camera& camera : rig.cameras) order.push_back(camera.id);
  EXPECT_EQ(order, (std::vector<uint32_t>{0, 7, 1, 3, 4, 5, 6, 2, 8, 9, 10, 11, 15, 13, 14, 12}));
  std::vector<Pose> poses;
  for (const Camera& camera : rig.cameras) poses.push_back(camera.pose);
  EXPECT_NEAR(neighbour_distance(poses), 0.06, 0.06 * 0.05);
}

TEST_F(DiagnosisTest, WithoutAPriorNoFindingNamesOne) {
  for (Observation& o : watched_.tracks.observations)
    if (o.camera == 3) o.pixel = {std::fmod(o.pixel.y * 37, 320), std::fmod(o.pixel.x * 41, 240)};
  const std::string all = all_findings();
  EXPECT_THAT(all, mentions("camera-not-found", "camera 3"));
  EXPECT_THAT(all, Not(HasSubstr("prior")));
}

struct Case {
  double moving = 0;
  double speed = 0;     // metres per second
  double late = 0.015;  // seconds; one sigma of the frame times
  bool other_k1 = false;
  bool wrong_camera = false;
};

MovingScene motion_in(const Case& how, uint64_t seed, std::vector<Finding>* findings = nullptr) {
  sim::ArrayOptions array;
  array.rows = array.columns = 4;
  if (how.other_k1) array.k2_spread = 0.1;
  const Rig truth = sim::make_array(array, seed);
  sim::Watched watched = sim::watch(truth, {.positions = 300, .noise = 0.1}, seed + 1);
  watched.tracks.ordered = false;
  std::mt19937_64 random(seed);
  std::normal_distribution<double> normal;
  std::vector<double> late(truth.cameras.size());
  for (double& t : late) t = how.late * normal(random);
  std::vector<Vec3> velocity(watched.lights.size(), Vec3(0));
  for (size_t j = 0; j < velocity.size(); j++)
    if (static_cast<double>(j) < how.moving * static_cast<double>(velocity.size()))
      velocity[j] = how.speed * Vec3(normal(random), normal(random), normal(random));
  for (Observation& o : watched.tracks.observations) {
    const Camera& camera = truth.cameras[o.camera];
    const Vec3 at = watched.lights[o.position], then = at + velocity[o.position] * late[o.camera];
    o.pixel += *camera.lens.project(camera.pose.camera_from_world(then)) -
               *camera.lens.project(camera.pose.camera_from_world(at));
    if (how.wrong_camera && o.camera == 5) o.pixel.x += 2 * normal(random);
  }
  SolveOptions options;
  sim::measure_lenses(truth, {}, seed + 2, options);
  if (how.other_k1) options.distortion = DistortionModel{1, true}, options.prior_covariances.clear();
  const Solution solution = solve_tracks(watched.tracks, options);
  if (findings)
    *findings = diagnose(solution, watched.tracks, options, place_solution(solution, watched.tracks, options, {}));
  return find_motion(solution, watched.tracks);
}

TEST(MovingScene, StaticSceneIsNotReported) {
  for (uint64_t seed = 1; seed <= 2; seed++) {
    EXPECT_LE(motion_in({}, seed).share, 0.02) << seed;
    EXPECT_LE(motion_in({.other_k1 = true}, seed).share, 0.02) << seed;
    EXPECT_LE(motion_in({.wrong_camera = true}, seed).share, 0.02) << seed;
  }
}

TEST(MovingScene, MotionIsReported) {
  for (uint64_t seed = 1; seed <= 2; seed++) {
    std::vector<Finding> findings;
    const MovingScene motion = motion_in({.moving = 0.3, .speed = 0.5}, seed, &findings);
    EXPECT_GE(motion.share, 0.15) << seed;
    EXPECT_LE(motion.share, 0.35) << seed;
    EXPECT_THAT(findings, testing::Contains(testing::Field(&Finding::code, "moving-scene"))) << seed;
  }
}

}  // namespace
}  // namespace lf
