// SPDX-License-Identifier: LGPL-2.1-or-later
#include "calibration/reconstruction.h"

#include <gtest/gtest.h>

#include "base/error.h"
#include "calibration/simulator.h"

namespace lf {
namespace {

class SceneTest : public testing::Test {
 protected:
  SceneTest() {
    array_.rows = array_.columns = 4;
    truth_ = sim::make_array(array_, 1);
    watched_ = sim::watch(truth_, {}, 2);
  }
  sim::ArrayOptions array_;
  Rig truth_;
  sim::Watched watched_;
  SolveOptions options_;
};

TEST_F(SceneTest, LensesAsUsualWithoutAPrior) {
  const Reconstruction scene = make_scene(watched_.tracks, options_);
  EXPECT_EQ(scene.cameras.size(), 16u);
  EXPECT_EQ(scene.targets.size(), 100u);
  EXPECT_DOUBLE_EQ(scene.cameras[3].lens_terms()[kCx], 159.5);
  for (int k = 0; k < kNumLensTerms; k++) EXPECT_FALSE(scene.measured(k)) << k;
}

TEST_F(SceneTest, APriorMustHaveTheCameras) {
  options_.prior = truth_;
  options_.prior->cameras.pop_back();
  EXPECT_THROW(make_scene(watched_.tracks, options_), Error);
  options_.prior = truth_;
  options_.prior->cameras[2].width = 100;
  EXPECT_THROW(make_scene(watched_.tracks, options_), Error);
  watched_.tracks.cameras.resize(1);
  EXPECT_THROW(make_scene(watched_.tracks, {}), Error);
}

TEST_F(SceneTest, InformationIsTheInverseOfTheCovarianceThatIsGiven) {
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

// A board's lens without distortion terms says nothing of them: they are not held at zero.
TEST_F(SceneTest, TermsThatWereNotMeasuredAreFound) {
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
  EXPECT_LE(std::abs(off), 0.03) << "of -0.15";
}

}  // namespace
}  // namespace lf
