// SPDX-License-Identifier: LGPL-2.1-or-later

#include <nlohmann/json.hpp>

#include "calibration/adjustment.h"
#include "calibration/noise.h"
#include "calibration/simulator.h"
#include "support/expect_error.h"
#include "support/test.h"

namespace lf {
namespace {

// A true scene with lights or bars, disturbed before the adjustment.
class BundleAdjustmentTest : public testing::TestWithParam<double> {
 protected:
  void watch(double noise, double outliers) {
    watched_ = sim::watch(truth_, {.bar = GetParam(), .noise = noise, .outliers = outliers}, 2);
    sim::measure_lenses(truth_, {}, 3, known_);
    scene_ = sim::true_scene(truth_, watched_, known_);
    scene_.lens_priors.assign(scene_.cameras.size(), {});
    use_.assign(observations().size(), true);
  }
  const std::vector<Observation>& observations() const { return watched_.tracks.observations; }
  void push_away() {
    std::mt19937_64 random(4);
    std::normal_distribution<double> normal;
    for (CameraState& camera : scene_.cameras) {
      Pose pose = camera.pose();
      pose.position += 0.01 * Vec3(normal(random), normal(random), normal(random));
      pose.orientation =
          Quat(1, 0.01 * normal(random), 0.01 * normal(random), 0.01 * normal(random)) * pose.orientation;
      camera.set_pose({pose.position, glm::normalize(pose.orientation)});
    }
    for (TargetState& target : scene_.targets)
      for (int k = 0; k < 3; k++) target.v[k] += 0.02 * normal(random);
  }
  double largest_residual() const {
    double largest = 0;
    const std::vector<double> lengths = residual_lengths(scene_, observations());
    for (size_t i = 0; i < lengths.size(); i++)
      if (watched_.good[i]) largest = std::max(largest, lengths[i]);
    return largest;
  }

  const Rig truth_ = sim::make_array({.rows = 3, .columns = 3}, 1);
  SolveOptions known_;
  sim::Watched watched_;
  Reconstruction scene_;
  Inliers use_;
};

TEST_P(BundleAdjustmentTest, ConvergesToTheTruth) {
  watch(0, 0);
  EXPECT_LT(largest_residual(), 1e-6);
  push_away();
  EXPECT_GT(largest_residual(), 1);
  const Reconstruction before = scene_;
  adjust(scene_, observations(), use_, {.tolerance = 1e-16});
  EXPECT_LT(largest_residual(), 1e-4);
  for (size_t i = 0; i < scene_.cameras.size(); i++)
    for (int k = 0; k < kNumLensTerms; k++)
      EXPECT_EQ(scene_.cameras[i].lens_terms()[k], before.cameras[i].lens_terms()[k]) << "was not free";
}

TEST_P(BundleAdjustmentTest, EstimatesFreeLensTerms) {
  watch(0, 0);
  const Reconstruction exact = scene_;
  for (CameraState& camera : scene_.cameras) camera.lens_terms()[kF] *= 1.02;
  AdjustmentOptions options{.sigma = 1e-3, .tolerance = 1e-16};
  options.free[kF] = true;
  adjust(scene_, observations(), use_, options);
  for (size_t i = 0; i < scene_.cameras.size(); i++)
    EXPECT_NEAR(scene_.cameras[i].lens_terms()[kF] / exact.cameras[i].lens_terms()[kF], 1, 1e-3) << i;
}

TEST_P(BundleAdjustmentTest, KeepsFixedTerms) {
  watch(0.2, 0);
  const Reconstruction before = scene_;
  adjust(scene_, observations(), use_, {.free_poses = false});
  for (size_t i = 0; i < scene_.cameras.size(); i++) EXPECT_EQ(scene_.cameras[i].v, before.cameras[i].v);
  EXPECT_NE(scene_.targets[5].v, before.targets[5].v);
}

TEST_P(BundleAdjustmentTest, RobustLossReducesTheEffectOfOutliers) {
  watch(0.2, 0.1);
  const Reconstruction before = scene_;
  adjust(scene_, observations(), use_, {.sigma = 0.2});
  const double least_squares = largest_residual();
  scene_ = before;
  adjust(scene_, observations(), use_, {.sigma = 0.2, .robust = 3});
  EXPECT_LT(largest_residual(), 1.5);
  EXPECT_GT(least_squares, 3 * largest_residual());
  scene_ = before;
  adjust(scene_, observations(), watched_.good, {.sigma = 0.2});
  EXPECT_LT(largest_residual(), 1.5);
}

TEST_P(BundleAdjustmentTest, UnusedParametersStay) {
  watch(0.2, 0);
  push_away();
  scene_.cameras[4].used = false;
  const Reconstruction before = scene_;
  adjust(scene_, observations(), use_, {});
  EXPECT_EQ(scene_.cameras[4].v, before.cameras[4].v);
  EXPECT_NE(scene_.cameras[3].v, before.cameras[3].v);
}

INSTANTIATE_TEST_SUITE_P(LightOrBar, BundleAdjustmentTest, testing::Values(0, 0.3));

std::vector<Pose> poses_of(const Rig& rig) {
  std::vector<Pose> poses;
  for (const Camera& camera : rig.cameras) poses.push_back(camera.pose);
  return poses;
}

Similarity some_similarity(const Vec3& translation) {
  return {3.5, glm::angleAxis(2.0, glm::normalize(Vec3(1, -2, 0.5))), translation};
}

void expect_found(const std::vector<Pose>& a, const Similarity& truth, double tolerance) {
  std::vector<Pose> b;
  for (const Pose& pose : a) b.push_back(truth(pose));
  const Similarity found = align(a, b);
  EXPECT_NEAR(found.scale, truth.scale, tolerance);
  for (size_t i = 0; i < a.size(); i++) {
    EXPECT_LE(glm::length(found(a[i]).position - b[i].position), tolerance);
    EXPECT_GE(std::abs(glm::dot(found(a[i]).orientation, b[i].orientation)), 1 - tolerance);
  }
}

TEST(Alignment, FindsASimilarity) {
  expect_found(poses_of(sim::make_array({}, 1)), some_similarity({5, 6, 7}), 1e-9);
  expect_found(poses_of(sim::make_array({}, 1)), some_similarity({1e4, 0, -1e4}), 1e-8);
}

TEST(Alignment, OrientationsDetermineTheRotationOfOneRow) {
  expect_found(poses_of(sim::make_array({.rows = 1, .position_jitter = 0}, 1)), some_similarity({0, 0, 1}), 1e-6);
}

TEST(Alignment, KeepsAFixedScale) {
  const std::vector<Pose> a = poses_of(sim::make_array({}, 1));
  std::vector<Pose> b;
  for (const Pose& pose : a) b.push_back(some_similarity({0, 0, 0})(pose));
  EXPECT_EQ(align(a, b, true).scale, 1);
}

// tests/calibration/accuracy_test.cc tests over many seeds that the covariance is correct.
class UncertaintyTest : public testing::Test {
 protected:
  UncertaintyTest() {
    sim::measure_lenses(truth_, {}, 3, options_);
    scene_ = sim::true_scene(truth_, watched_, options_);
    model_.free = {true, true, true, true, true};
    model_.sigma = 0.2;
  }
  Uncertainty estimate() { return estimate_uncertainty(scene_, watched_.tracks.observations, watched_.good, model_); }

  const Rig truth_ = sim::make_array({.rows = 3, .columns = 3}, 1);
  sim::Watched watched_ = sim::watch(truth_, {}, 2);
  SolveOptions options_;
  Reconstruction scene_;
  AdjustmentOptions model_;
};

TEST_F(UncertaintyTest, HasRowsForFreeParametersOfUsedCameras) {
  scene_.cameras[4].used = false;
  model_.free[kK2] = false;
  const Uncertainty u = estimate();
  EXPECT_EQ(u.camera_size, 10);
  EXPECT_EQ(u.covariance.rows(), 80);
  EXPECT_EQ(u.prior_covariance.rows(), 32);
  EXPECT_EQ(u.camera_row[4], -1);
  EXPECT_EQ(u.camera_row[5], 40);
  EXPECT_EQ(u.lens_terms, (std::vector<int>{kF, kCx, kCy, kK1}));
  EXPECT_GT(u.covariance.diagonal().minCoeff(), 0);
}

TEST_F(UncertaintyTest, GrowsWithTheNoiseUpToThePrior) {
  model_.free = {true};
  const double before = estimate().covariance(6, 6);
  model_.sigma *= 2;
  const Uncertainty noisy = estimate();
  EXPECT_GT(noisy.covariance(6, 6), before);
  EXPECT_LT(noisy.covariance(6, 6), noisy.prior_covariance(0, 0));
  for (Observation& o : watched_.tracks.observations) o.sigma = 2;
  model_.sigma /= 2;
  EXPECT_NEAR(estimate().covariance(6, 6), noisy.covariance(6, 6), 1e-9 * before);
}

// Moving, turning or scaling all cameras together is not an error: common steps of the centres have no variance.
TEST_F(UncertaintyTest, IsInTheAlignedGauge) {
  const Uncertainty u = estimate();
  for (int axis = 0; axis < 3; axis++) {
    Eigen::VectorXd all = Eigen::VectorXd::Zero(u.covariance.rows());
    for (const int row : u.camera_row) all[row + 3 + axis] = 1;
    EXPECT_NEAR(all.dot(u.covariance * all), 0, 1e-6 * u.covariance(3 + axis, 3 + axis));
  }
}

// The clock of one camera alone, with a point that moves: the other parameters are certain, so its information is the
// sum over the squared velocities.
TEST_F(UncertaintyTest, CoversClocks) {
  const auto& observations = watched_.tracks.observations;
  ClockAdjustment clocks;
  clocks.cameras.resize(truth_.cameras.size(), {.rolls = true});
  clocks.velocity.assign(observations.size(), Vec2(0, 0));
  clocks.stamp.assign(observations.size(), 0);
  clocks.row.assign(observations.size(), 0);
  const auto now = [&] { return estimate_uncertainty(scene_, observations, watched_.good, model_, &clocks); };
  const Uncertainty still = now(), none = estimate();
  EXPECT_EQ(still.covariance.rows(), none.covariance.rows());
  EXPECT_LT((still.covariance - none.covariance).norm(), 1e-6 * none.covariance.norm());
  EXPECT_NEAR(still.clock_sigmas[2][2], 0.2, 1e-6);
  std::mt19937_64 random(1);
  std::normal_distribution<double> normal(0, 500);
  double information = 0;
  for (size_t i = 0; i < observations.size(); i++) {
    clocks.row[i] = normal(random) / 2000;
    if (observations[i].camera != 2) continue;
    clocks.velocity[i] = Vec2(normal(random), normal(random));
    information += glm::dot(clocks.velocity[i], clocks.velocity[i]) * clocks.row[i] * clocks.row[i];
  }
  const Uncertainty moving = now();
  const double alone = model_.sigma / std::sqrt(information);
  // The velocities are random, so poses, lenses and points absorb only a part of the readout time.
  EXPECT_GT(moving.clock_sigmas[2][2], alone);
  EXPECT_LT(moving.clock_sigmas[2][2], 1.5 * alone);
  // The offset is relative to the mean of the other cameras. Their offsets have the uncertainty of the prior, 0.1 s.
  const auto cameras = static_cast<double>(truth_.cameras.size());
  EXPECT_NEAR(moving.clock_sigmas[2][0], 0.1 * std::sqrt(cameras - 1) / cameras, 1e-5);
  EXPECT_NEAR(moving.clock_sigmas[1][2], 0.2, 1e-6);
  const Eigen::VectorXd more = moving.covariance.diagonal() - none.covariance.diagonal();
  EXPECT_GT(more.minCoeff(), -1e-9 * none.covariance.diagonal().maxCoeff());
}

std::optional<CameraCovariance> parse(const std::string& text) {
  const std::string name = "rig.json";
  const nlohmann::json root = parse_json(text, name);
  return parse_camera_covariance(JsonValue(root, name));
}

TEST(CameraCovariance, RoundTrips) {
  const CameraCovariance covariance{{"f", "cx"}, {4, 1, 1, 2}};
  const nlohmann::json camera = {{"covariance", nlohmann::json::parse(to_json(covariance).dump())}};
  const CameraCovariance again = parse(camera.dump()).value();
  EXPECT_EQ(again.parameters, covariance.parameters);
  EXPECT_EQ(again.matrix, covariance.matrix);
  EXPECT_EQ(again.index_of("cx"), 1u);
  EXPECT_EQ(again.index_of("k1"), std::nullopt);
  EXPECT_FALSE(parse("{}"));
  EXPECT_FALSE(parse(R"({"covariance": {}})"));
}

TEST(CameraCovariance, ErrorsNameThePlace) {
  const auto expect_error = [](const std::string& parameters, const std::string& matrix,
                               const std::vector<std::string>& facts) {
    EXPECT_ERROR(parse(R"({"covariance": {"parameters": )" + parameters + R"(, "matrix": )" + matrix + "}}"), facts);
  };
  expect_error(R"(["f", "zoom"])", "[[1, 0], [0, 1]]", {"covariance.parameters[1]", "zoom"});
  expect_error(R"(["f", "f"])", "[[1, 0], [0, 1]]", {"comes twice"});
  expect_error(R"(["f", "cx"])", "[[1, 0], [0]]", {"covariance.matrix[1]", "2"});
  expect_error(R"(["f", "cx"])", "[[1, 0], [0, -1]]", {"variance", "negative"});
  expect_error(R"(["f", "cx"])", "[[1, 0.5], [0, 1]]", {"not symmetric"});
  expect_error(R"(["f", "cx"])", "[[1, 2], [2, 1]]", {"correlation", "1"});
}

}  // namespace
}  // namespace lf
