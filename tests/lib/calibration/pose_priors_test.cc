// SPDX-License-Identifier: LGPL-2.1-or-later
#include "calibration/pose_priors.h"

#include <set>

#include <gtest/gtest.h>

#include "calibration/diagnosis.h"
#include "calibration/simulator.h"

namespace lf {
namespace {

constexpr double kPositionSigma = 2e-4, kTurnSigma = 2e-4;  // metres, radians

// Cameras whose places were measured, to within a similarity, and whose lenses were not.
class PosePriorsTest : public testing::Test {
 protected:
  PosePriorsTest() {
    array_.rows = array_.columns = 5;
    truth_ = sim::make_array(array_, 1);
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
    double off = 0, told = 0;  // of the mean focal length, pixels
    Solution solution;
    std::string findings;
  };
  Result solve(double bar) {
    sim::PathOptions path;
    path.bar = bar;
    const sim::Watched watched = sim::watch(truth_, path, 2);
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

  sim::ArrayOptions array_;
  Rig truth_;
  SolveOptions options_;
};

TEST_F(PosePriorsTest, KnownPosesTellTheFocalLengthOfOneLight) {
  const Result known = solve(0);
  EXPECT_LE(std::abs(known.off), 3 * known.told);
  EXPECT_LE(known.told, 6) << "1.5 % of the focal length";
  EXPECT_TRUE(known.solution.contradicted_poses.empty());
  options_.prior_covariances.clear();
  EXPECT_GE(solve(0).told, 2 * known.told);
}

TEST_F(PosePriorsTest, ABarHasAScaleOfItsOwn) {
  const Result result = solve(0.3);
  EXPECT_NEAR(result.solution.scene.metres, 0.3, 1e-3);
  EXPECT_LE(std::abs(result.off), 3 * result.told);
}

TEST_F(PosePriorsTest, APoseThatIsWrongIsLeftOutAndNamed) {
  std::swap(options_.prior->cameras[3].pose, options_.prior->cameras[17].pose);
  const Result result = solve(0.3);
  EXPECT_EQ(std::set<size_t>(result.solution.contradicted_poses.begin(), result.solution.contradicted_poses.end()),
            (std::set<size_t>{3, 17}));
  EXPECT_NE(result.findings.find("prior-contradicted"), std::string::npos) << result.findings;
  EXPECT_LE(std::abs(result.off), 3 * result.told);
}

}  // namespace
}  // namespace lf
