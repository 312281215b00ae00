// SPDX-License-Identifier: LGPL-2.1-or-later
#include "calibration/reconstruction.h"

#include "base/text.h"
#include "calibration/diagnosis.h"
#include "calibration/simulator.h"
#include "support/test.h"

namespace lf {
namespace {

class SceneTest : public testing::Test {
 protected:
  const Rig truth_ = sim::make_array({.rows = 4, .columns = 4}, 1);
  sim::Watched watched_ = sim::watch(truth_, {}, 2);
  SolveOptions options_;
};

TEST_F(SceneTest, DefaultLensesWithoutAPrior) {
  const Reconstruction scene = make_scene(watched_.tracks, options_);
  EXPECT_EQ(scene.cameras.size(), 16u);
  EXPECT_EQ(scene.targets.size(), 100u);
  EXPECT_DOUBLE_EQ(scene.cameras[3].lens_terms()[kCx], 159.5);
  for (int k = 0; k < kNumLensTerms; k++) EXPECT_FALSE(scene.measured(k)) << k;
}

TEST_F(SceneTest, PriorMustHaveTheCameras) {
  options_.prior = truth_;
  options_.prior->cameras.pop_back();
  EXPECT_THROW(make_scene(watched_.tracks, options_), Error);
  options_.prior = truth_;
  options_.prior->cameras[2].width = 100;
  EXPECT_THROW(make_scene(watched_.tracks, options_), Error);
  watched_.tracks.cameras.resize(1);
  EXPECT_THROW(make_scene(watched_.tracks, {}), Error);
}

TEST_F(SceneTest, InformationIsTheInverseOfTheCovariance) {
  options_.prior = truth_;
  options_.prior_covariances = {CameraCovariance{{"cx", "f"}, {4, 1, 1, 1}}};
  const Reconstruction scene = make_scene(watched_.tracks, options_);
  ASSERT_TRUE(scene.lens_priors[0]);
  EXPECT_FALSE(scene.lens_priors[1]);
  EXPECT_TRUE(scene.measured(0, kF) && scene.measured(0, kCx));
  EXPECT_FALSE(scene.measured(0, kCy) || scene.measured(0, kK1) || scene.measured(1, kF));
  const auto information = [&](int a, int b) {
    double sum = 0;
    for (int r = 0; r < kNumLensTerms; r++)
      sum += scene.lens_priors[0]->root_information[r * kNumLensTerms + a] *
             scene.lens_priors[0]->root_information[r * kNumLensTerms + b];
    return sum;
  };
  EXPECT_NEAR(information(kF, kF), 4 / 3.0, 1e-6);
  EXPECT_NEAR(information(kF, kCx), -1 / 3.0, 1e-6);
  EXPECT_NEAR(information(kCx, kCx), 1 / 3.0, 1e-6);
  EXPECT_EQ(information(kK1, kK1), 0);
}

// A board calibration without distortion terms gives no prior for them: they are estimated, not fixed at zero.
TEST_F(SceneTest, UnmeasuredTermsAreEstimated) {
  sim::measure_lenses(truth_, {}, 3, options_);
  CameraCovariance covariance{{"f", "cx", "cy"}, {1, 0, 0, 0, 2.25, 0, 0, 0, 2.25}};
  options_.prior_covariances.assign(16, covariance);
  for (Camera& camera : options_.prior->cameras) {
    auto params = camera.lens.params();
    params[kK1] = params[kK2] = 0;
    camera.lens = Lens(LensModel::kRadial, params);
  }
  const Solution solution = solve_tracks(watched_.tracks, options_);
  ASSERT_GE(solution.distortion.terms, 1);
  double off = 0;
  for (size_t i = 0; i < 16; i++)
    off += (solution.scene.cameras[i].lens_terms()[kK1] - truth_.cameras[i].lens.k1()) / 16;
  EXPECT_LE(std::abs(off), 0.03) << "true value -0.15";
}

constexpr double kPositionSigma = 2e-4, kTurnSigma = 2e-4;  // metres, radians

// Cameras with measured positions, up to a similarity, and unmeasured lenses.
class PosePriorsTest : public testing::Test {
 protected:
  PosePriorsTest() {
    options_.prior = truth_;
    options_.distortion = DistortionModel{2, true};
    std::mt19937_64 random(3);
    std::normal_distribution<double> normal;
    const auto vector = [&](double sigma) { return sigma * Vec3(normal(random), normal(random), normal(random)); };
    CameraCovariance covariance{{"x", "y", "z", "rx", "ry", "rz"}, std::vector<double>(36)};
    for (int k = 0; k < 6; k++) covariance.matrix[k * 7] = std::pow(k < 3 ? kPositionSigma : kTurnSigma, 2);
    options_.prior_covariances.assign(25, covariance);
    for (Camera& camera : options_.prior->cameras) {
      const Vec3 turn = vector(kTurnSigma);
      camera.pose.position += vector(kPositionSigma) + Vec3(100, 0, 0);
      camera.pose.orientation = glm::angleAxis(glm::length(turn), glm::normalize(turn)) * camera.pose.orientation;
      camera.lens = Lens(LensModel::kRadial, {400, 159.5, 119.5, 0, 0});
    }
  }

  struct Result {
    double off = 0, told = 0;  // error of the mean focal length, pixels
    Solution solution;
    std::string findings;
  };
  Result solve(double bar) {
    const sim::Watched watched = sim::watch(truth_, {.bar = bar}, 2);
    Result result;
    result.solution = solve_tracks(watched.tracks, options_);
    const Uncertainty& u = result.solution.uncertainty;
    Eigen::VectorXd mean = Eigen::VectorXd::Zero(u.covariance.rows());
    for (size_t i = 0; i < 25; i++) {
      mean[u.camera_row[i] + 6] = 1 / 25.0;
      result.off += (result.solution.scene.cameras[i].lens_terms()[kF] - truth_.cameras[i].lens.fx()) / 25;
    }
    result.told = u.sigma_of(mean);
    for (const Finding& f : diagnose(result.solution, watched.tracks, options_,
                                     place_solution(result.solution, watched.tracks, options_, {})))
      result.findings += f.code + " ";
    return result;
  }

  const Rig truth_ = sim::make_array({.rows = 5, .columns = 5}, 1);
  SolveOptions options_;
};

TEST_F(PosePriorsTest, KnownPosesDetermineTheFocalLength) {
  const Result known = solve(0);
  EXPECT_LE(std::abs(known.off), 3 * known.told);
  EXPECT_LE(known.told, 6) << "1.5 % of the focal length";
  EXPECT_TRUE(known.solution.contradicted_poses.empty());
  options_.prior_covariances.clear();
  EXPECT_GE(solve(0).told, 2 * known.told);
}

TEST_F(PosePriorsTest, BarDeterminesTheScale) {
  const Result result = solve(0.3);
  EXPECT_NEAR(result.solution.scene.metres, 0.3, 1e-3);
  EXPECT_LE(std::abs(result.off), 3 * result.told);
}

TEST_F(PosePriorsTest, WrongPoseIsNamedAndLeftOut) {
  std::swap(options_.prior->cameras[3].pose, options_.prior->cameras[17].pose);
  const Result result = solve(0.3);
  EXPECT_EQ(std::set<size_t>(result.solution.contradicted_poses.begin(), result.solution.contradicted_poses.end()),
            (std::set<size_t>{3, 17}));
  EXPECT_NE(result.findings.find("prior-contradicted"), std::string::npos) << result.findings;
  EXPECT_LE(std::abs(result.off), 3 * result.told);
}

}  // namespace
}  // namespace lf
