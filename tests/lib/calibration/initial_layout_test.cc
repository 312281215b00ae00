// SPDX-License-Identifier: LGPL-2.1-or-later
#include "calibration/initial_layout.h"
#include "calibration/reconstruction.h"
#include "calibration/simulator.h"
#include "support/test.h"

namespace lf {
namespace {

// Returns the position errors of the cameras in use after the best similarity alignment, in metres in the truth's
// frame.
std::vector<Vec3> position_errors(const Reconstruction& scene, const Rig& truth) {
  std::vector<Pose> found, expected;
  for (size_t i = 0; i < truth.cameras.size(); i++) {
    if (!scene.cameras[i].used) continue;
    found.push_back(scene.cameras[i].pose());
    expected.push_back(truth.cameras[i].pose);
  }
  const Similarity s = align(found, expected);
  std::vector<Vec3> errors;
  for (size_t i = 0; i < found.size(); i++) errors.push_back(s(found[i]).position - expected[i].position);
  return errors;
}

// Returns the root mean square length of the errors after `part`, which selects the whole error or its share in a
// plane.
template <typename Part>
double root_mean_square(const std::vector<Vec3>& errors, const Part& part) {
  double sum = 0;
  for (const Vec3& error : errors) sum += glm::dot(part(error), part(error));
  return std::sqrt(sum / static_cast<double>(errors.size()));
}

std::vector<ColumnDetection> make_sights(double missed, double mistaken, std::vector<Vec2>& centres) {
  std::mt19937 random(3);
  const auto uniform = [&](double a, double b) { return std::uniform_real_distribution<double>(a, b)(random); };
  std::vector<Vec2> turns;
  for (int i = 0; i < 16; i++) {
    centres.emplace_back(i % 4 - 1.5, i / 4 - 1.5);
    turns.emplace_back(uniform(-0.02, 0.02), uniform(-0.02, 0.02));
  }
  std::vector<ColumnDetection> sights;
  for (uint32_t j = 0; j < 60; j++) {
    const Vec2 direction(uniform(-0.3, 0.3), uniform(-0.3, 0.3));
    const double disparity = uniform(0.02, 0.08);
    for (uint32_t i = 0; i < 16; i++) {
      if (uniform(0, 1) < missed) continue;
      Vec2 uv = direction - centres[i] * disparity + turns[i];
      if (uniform(0, 1) < mistaken) uv = {uniform(-0.4, 0.4), uniform(-0.3, 0.3)};
      sights.push_back({i, j, uv});
    }
  }
  return sights;
}

void expect_layout(const DisparityFactors& factors, const std::vector<Vec2>& centres, double tolerance) {
  double cc = 0, cf = 0;
  for (size_t i = 0; i < centres.size(); i++)
    cc += glm::dot(factors.cameras[i].centre, factors.cameras[i].centre),
        cf += glm::dot(factors.cameras[i].centre, centres[i]);
  for (size_t i = 0; i < centres.size(); i++)
    EXPECT_LE(glm::length(factors.cameras[i].centre * (cf / cc) - centres[i]), tolerance) << i;
}

TEST(DisparityFactorisation, ExactDetectionsGiveTheLayout) {
  std::vector<Vec2> centres;
  const auto factors = factorise_disparities(make_sights(0, 0, centres), 16, 60, 0.02);
  expect_layout(factors, centres, 1e-2);
  EXPECT_EQ(factors.inliers, 1);
  for (const auto& column : factors.columns) EXPECT_GT(column.disparity, 0);
}

TEST(DisparityFactorisation, ToleratesMissedDetectionsAndOutliers) {
  std::vector<Vec2> centres;
  const auto factors = factorise_disparities(make_sights(0.3, 0.15, centres), 16, 60, 0.02);
  expect_layout(factors, centres, 0.05);
  EXPECT_NEAR(factors.inliers, 0.85, 0.05);
}

TEST(DisparityFactorisation, CameraWithoutDetectionsIsUnknown) {
  std::vector<Vec2> centres;
  std::vector<ColumnDetection> sights = make_sights(0, 0, centres);
  std::erase_if(sights, [](const ColumnDetection& s) { return s.camera == 5; });
  const auto factors = factorise_disparities(sights, 16, 60, 0.02);
  EXPECT_EQ(factors.cameras[5].inliers, 0);
  EXPECT_EQ(factors.inliers, 1);
}

TEST(DisparityFactorisation, TooFewDetectionsGiveNothing) {
  EXPECT_EQ(factorise_disparities({}, 3, 4, 0.02).inliers, 0);
}

class InitialLayoutTest : public testing::Test {
 protected:
  Reconstruction watch(double bar, double outliers) {
    tracks_ = sim::watch(truth_, {.bar = bar, .outliers = outliers}, 2).tracks;
    Reconstruction scene = make_scene(tracks_, {});
    for (CameraState& camera : scene.cameras) camera.lens_terms()[kF] = 420;
    scene.batch_mean[kF] = 420;
    return scene;
  }
  double error(const Reconstruction& scene) {
    return root_mean_square(position_errors(scene, truth_), [](const Vec3& e) { return Vec2(e); }) / 0.06;
  }

  const Rig truth_ = sim::make_array({.rows = 4, .columns = 4}, 1);
  Tracks tracks_;
};

TEST_F(InitialLayoutTest, DisparitiesPlaceAnArray) {
  Reconstruction scene = watch(0, 0);
  EXPECT_GT(layout_from_disparities(scene, tracks_), 0.8);
  for (const CameraState& camera : scene.cameras) EXPECT_TRUE(camera.used);
  EXPECT_LT(error(scene), 0.3);
  size_t placed = 0;
  for (const TargetState& target : scene.targets) placed += target.kind == TargetState::Kind::kPoint;
  EXPECT_GT(placed, scene.targets.size() * 8 / 10);
}

TEST_F(InitialLayoutTest, OutliersLowerTheShareOfInliers) {
  Reconstruction clean = watch(0, 0);
  const double all = layout_from_disparities(clean, tracks_);
  Reconstruction dirty = watch(0, 0.2);
  const double some = layout_from_disparities(dirty, tracks_);
  EXPECT_LT(some, all - 0.1);
  EXPECT_LT(error(dirty), 0.4);
}

TEST_F(InitialLayoutTest, UnconnectedCamerasAreLeftOut) {
  Reconstruction scene = watch(0, 0);
  std::mt19937_64 random(3);
  for (Observation& o : tracks_.observations)
    if (o.camera == 5)
      o.pixel = {std::uniform_real_distribution<>(0, 319)(random), std::uniform_real_distribution<>(0, 239)(random)};
  layout_from_disparities(scene, tracks_);
  EXPECT_FALSE(scene.cameras[5].used);
  EXPECT_TRUE(scene.cameras[6].used);
}

TEST_F(InitialLayoutTest, BarsAreTheUnitOfLength) {
  Reconstruction scene = watch(0.3, 0);
  for (size_t i = 0; i < scene.cameras.size(); i++) {
    scene.cameras[i].set_pose(truth_.cameras[i].pose);
    scene.cameras[i].set_lens(truth_.cameras[i].lens);
    scene.cameras[i].used = true;
  }
  triangulate_from_poses(scene, tracks_, 2);
  const double apart = glm::distance(scene.cameras[0].pose().position, scene.cameras[15].pose().position);
  const double metres = glm::distance(truth_.cameras[0].pose.position, truth_.cameras[15].pose.position);
  EXPECT_NEAR(apart, metres / 0.3, 0.02 * apart);
  size_t bars = 0;
  for (const TargetState& target : scene.targets) bars += target.kind == TargetState::Kind::kBar;
  EXPECT_GT(bars, scene.targets.size() / 2);
}

class ResectionTest : public testing::Test {
 protected:
  // All cameras but camera 5 are at their true poses; a quarter of the observations of camera 5 is wrong.
  ResectionTest() {
    scene_.cameras[5].used = false;
    scene_.cameras[5].set_pose({{9, 9, 9}, {1, 0, 0, 0}});
  }
  const Rig truth_ = sim::make_array({.rows = 3, .columns = 3}, 1);
  sim::Watched watched_ = sim::watch(truth_, {.outliers = 0.25}, 2);
  Reconstruction scene_ = sim::true_scene(truth_, watched_, {});
};

TEST_F(ResectionTest, PlacesACameraFromItsObservations) {
  EXPECT_EQ(resect_cameras(scene_, watched_.tracks, 2), 1);
  EXPECT_TRUE(scene_.cameras[5].used);
  EXPECT_LE(glm::length(scene_.cameras[5].pose().position - truth_.cameras[5].pose.position), 0.01);
  EXPECT_EQ(resect_cameras(scene_, watched_.tracks, 2), 0) << "all are placed";
}

TEST_F(ResectionTest, DoesNotDependOnTheUnitOfLength) {
  for (const double unit : {1e-3, 1e4}) {
    Reconstruction scaled = scene_;
    for (CameraState& camera : scaled.cameras)
      for (int i = 4; i < 7; i++) camera.v[i] *= unit;
    for (TargetState& target : scaled.targets)
      for (int i = 0; i < 3; i++) target.v[i] *= unit;
    ASSERT_EQ(resect_cameras(scaled, watched_.tracks, 2), 1) << unit;
    EXPECT_LE(glm::length(scaled.cameras[5].pose().position / unit - truth_.cameras[5].pose.position), 0.01) << unit;
  }
}

TEST_F(ResectionTest, FailsWithTracksOfAnotherCamera) {
  for (Observation& o : watched_.tracks.observations)
    if (o.camera == 5) o.position = (o.position + 7) % 100;
  EXPECT_EQ(resect_cameras(scene_, watched_.tracks, 2), 0);
  EXPECT_FALSE(scene_.cameras[5].used);
}

TEST_F(ResectionTest, FailsWithFewOrCoincidentPoints) {
  Reconstruction at_one = scene_;
  for (TargetState& target : at_one.targets) target.v = {0, 0, 1};
  EXPECT_EQ(resect_cameras(at_one, watched_.tracks, 2), 0);
  std::erase_if(watched_.tracks.observations, [](const Observation& o) { return o.camera == 5 && o.position > 5; });
  EXPECT_EQ(resect_cameras(scene_, watched_.tracks, 2), 0);
}

using sim::Around;

class PairsLayoutTest : public testing::TestWithParam<std::tuple<Around, double>> {
 protected:
  PairsLayoutTest() {
    sim::PathOptions path{.near = 0.5, .shape = sim::PathOptions::Shape::kBall, .missed = 0.3, .outliers = 0.1};
    path.bar = std::get<1>(GetParam());
    tracks_ = sim::watch(truth_, path, 2).tracks;
  }
  double error(const Reconstruction& scene) {
    return root_mean_square(position_errors(scene, truth_), [](const Vec3& e) { return e; });
  }
  Reconstruction with_approximate_lenses() {
    Reconstruction scene = make_scene(tracks_, {});
    for (CameraState& camera : scene.cameras) camera.lens_terms()[kF] = 600;
    return scene;
  }

  const Rig truth_ = sim::make_rig_around(std::get<0>(GetParam()), 14, 1);
  Tracks tracks_;
};

TEST_P(PairsLayoutTest, GlobalAndIncrementalLayout) {
  for (const auto layout : {global_layout, incremental_layout}) {
    SCOPED_TRACE(layout == global_layout ? "global" : "incremental");
    Reconstruction scene = with_approximate_lenses();
    EXPECT_EQ(layout(scene, tracks_, 8), 14);
    EXPECT_LE(error(scene), 0.1);
  }
}

TEST_P(PairsLayoutTest, SolvesFromTheLayout) {
  const Solution solution = solve_tracks(tracks_, {});
  EXPECT_EQ(solution.start, "averaged pairs");
  for (const CameraState& camera : solution.scene.cameras) EXPECT_TRUE(camera.used);
  EXPECT_LE(error(solution.scene), 0.03);
  EXPECT_NEAR(solution.sigma, 0.2, 0.02);
}

INSTANTIATE_TEST_SUITE_P(Rigs, PairsLayoutTest,
                         testing::Combine(testing::Values(Around::kRing, Around::kDome, Around::kAnywhere),
                                          testing::Values(0, 0.3)));

TEST(PairsLayout, FailsWithoutEnoughCommonObservations) {
  const Rig truth = sim::make_rig_around(Around::kRing, 4, 1);
  const Tracks tracks =
      sim::watch(truth, {.positions = 8, .near = 0.5, .shape = sim::PathOptions::Shape::kBall}, 2).tracks;
  Reconstruction scene = make_scene(tracks, {});
  EXPECT_EQ(global_layout(scene, tracks, 8), 0);
  EXPECT_EQ(incremental_layout(scene, tracks, 8), 0);
}

}  // namespace
}  // namespace lf
