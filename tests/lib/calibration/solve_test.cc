// SPDX-License-Identifier: LGPL-2.1-or-later
// tests/calibration/accuracy_test.cc and hard_cases_test.cc test the accuracy of solutions.
#include <tuple>

#include "base/text.h"
#include "calibration/noise.h"
#include "calibration/simulator.h"
#include "calibration/solve.h"
#include "support/expect_error.h"
#include "support/test.h"

namespace lf {
namespace {

class SolveTest : public testing::Test {
 protected:
  const Rig truth_ = sim::make_array({.rows = 3, .columns = 3}, 1);
  sim::Watched watched_ = sim::watch(truth_, {.positions = 60, .outliers = 0.05}, 2);
};

TEST_F(SolveTest, FindsCamerasLightsAndNoise) {
  SolveOptions options;
  sim::measure_lenses(truth_, {}, 3, options);
  const Solution solution = solve_tracks(watched_.tracks, options);
  ASSERT_EQ(solution.inliers.size(), watched_.tracks.observations.size());
  for (const CameraState& camera : solution.scene.cameras) EXPECT_TRUE(camera.used);
  EXPECT_NEAR(solution.sigma, 0.2, 0.03);
  const std::vector<double> lengths = residual_lengths(solution.scene, watched_.tracks.observations);
  size_t wrong = 0;
  for (size_t i = 0; i < lengths.size(); i++) wrong += (solution.inliers[i] != 0) != (watched_.good[i] != 0);
  EXPECT_LT(wrong, lengths.size() / 50);
  EXPECT_EQ(solution.uncertainty.camera_row.size(), 9u);
}

TEST_F(SolveTest, IsReproducible) {
  const Solution a = solve_tracks(watched_.tracks, {.distortion = DistortionModel{1, true}});
  const Solution b = solve_tracks(watched_.tracks, {.distortion = DistortionModel{1, true}});
  for (size_t i = 0; i < 9; i++)
    for (int k = 0; k < CameraState::kSize; k++)
      EXPECT_NEAR(a.scene.cameras[i].v[k], b.scene.cameras[i].v[k], 1e-6) << i << ", " << k;
  EXPECT_EQ(a.inliers, b.inliers);
}

TEST_F(SolveTest, KeepsAGivenModel) {
  const Solution solution = solve_tracks(watched_.tracks, {.distortion = DistortionModel{0, false}});
  EXPECT_EQ(solution.distortion, (DistortionModel{0, false}));
  EXPECT_TRUE(solution.trials.empty());
  EXPECT_FALSE(solution.model.free[kK1]);
  for (const CameraState& camera : solution.scene.cameras) EXPECT_EQ(camera.lens_terms()[kK1], 0);
}

TEST_F(SolveTest, ReportsProgressAndCanBeCancelled) {
  std::vector<std::string> steps;
  SolveOptions options;
  options.distortion = DistortionModel{1, true};
  options.progress = [&](const std::string& step) { steps.push_back(step); };
  solve_tracks(watched_.tracks, options);
  EXPECT_GT(steps.size(), 2u);
  options.progress = [](const std::string&) { throw Error("cancelled"); };
  EXPECT_ERROR(solve_tracks(watched_.tracks, options), "cancelled");
}

TEST_F(SolveTest, ErrorsNameThePlace) {
  Tracks one = watched_.tracks;
  one.cameras.resize(1);
  std::erase_if(one.observations, [](const Observation& o) { return o.camera > 0; });
  EXPECT_ERROR(solve_tracks(one, {}), "two cameras");
  SolveOptions options;
  options.prior = truth_;
  options.prior->cameras.pop_back();
  EXPECT_ERROR(solve_tracks(watched_.tracks, options), "id 8");
  options.prior = truth_;
  options.prior->cameras[2].width = 99;
  EXPECT_ERROR(solve_tracks(watched_.tracks, options), "camera 2");
  Tracks alone = watched_.tracks;
  std::erase_if(alone.observations, [](const Observation& o) { return o.position % 9 != o.camera; });
  EXPECT_ERROR(solve_tracks(alone, {}), "two cameras", "light");
}

// Twenty cameras on a dome with tilted lenses; some cameras see three tenths of the positions. Lens measurements lack
// the tilt, or are missing.
class PartialVisibility : public testing::TestWithParam<std::tuple<uint64_t, bool>> {
 protected:
  PartialVisibility() {
    const uint64_t seed = std::get<0>(GetParam());
    truth_ = sim::make_rig_around(sim::Around::kDome, 20, seed);
    std::mt19937_64 random(seed);
    std::normal_distribution<double> normal;
    for (Camera& camera : truth_.cameras) {
      const auto p = camera.lens.params();
      camera.lens =
          Lens(LensModel::kOpenCv, {p[0], p[0], p[1], p[2], p[3], p[4], 1e-2 * normal(random), 1e-2 * normal(random)});
    }
    watched_ = sim::watch(truth_,
                          {.positions = 300,
                           .near = 0.8,
                           .shape = sim::PathOptions::Shape::kBall,
                           .noise = 0.3,
                           .missed = 0.1,
                           .outliers = 0.03},
                          seed + 1);
    std::vector<Observation> seen;
    Inliers good;
    for (size_t i = 0; i < watched_.good.size(); i++) {
      const Observation& o = watched_.tracks.observations[i];
      if (o.camera % 4 == 0 && std::uniform_real_distribution<>()(random) > 0.3) continue;
      seen.push_back(o), good.push_back(watched_.good[i]);
    }
    watched_.tracks.observations = std::move(seen), watched_.good = std::move(good);
    if (!std::get<1>(GetParam())) return;
    options_.prior = truth_;
    for (Camera& camera : options_.prior->cameras) {
      const auto p = camera.lens.params();
      camera.lens = Lens(LensModel::kRadial, {p[0], p[2], p[3], p[4], p[5]});
      camera.pose = {};
    }
  }
  Rig truth_;
  sim::Watched watched_;
  SolveOptions options_;
};

TEST_P(PartialVisibility, FindsAllCamerasWithFewOutliers) {
  const Solution solution = solve_tracks(watched_.tracks, options_);
  for (const CameraState& camera : solution.scene.cameras) EXPECT_TRUE(camera.used);
  EXPECT_TRUE(solution.distortion.tangential) << solution.distortion.name();
  std::vector<double> good(20), wrong(20);
  for (size_t i = 0; i < solution.inliers.size(); i++) {
    const uint32_t camera = watched_.tracks.observations[i].camera;
    good[camera] += watched_.good[i], wrong[camera] += watched_.good[i] && !solution.inliers[i];
  }
  double worst = 0;
  for (size_t i = 0; i < 20; i++) worst = std::max(worst, wrong[i] / std::max(1.0, good[i]));
  std::printf("sigma %.3f px, at most %.1f %% of a camera's good sights are called outliers, %s\n", solution.sigma,
              100 * worst, solution.distortion.name().c_str());
  EXPECT_LE(worst, 0.05);
  EXPECT_LE(solution.sigma, 0.36);
}

INSTANTIATE_TEST_SUITE_P(Seeds, PartialVisibility, testing::Combine(testing::Values(1, 2), testing::Bool()));

// The report must name the camera that is out of focus; its observations are not outliers.
TEST_F(SolveTest, NoisyCameraIsDownWeighted) {
  std::mt19937_64 random(5);
  std::normal_distribution<double> normal(0, 0.6);
  for (Observation& o : watched_.tracks.observations)
    if (o.camera == 4) o.pixel += Vec2(normal(random), normal(random));
  SolveOptions options;
  sim::measure_lenses(truth_, {}, 3, options);
  const Solution solution = solve_tracks(watched_.tracks, options);
  EXPECT_NEAR(solution.camera_noise[4], 3, 0.8);
  EXPECT_EQ(solution.camera_noise[3], 1);
  size_t good = 0, wrong = 0;
  for (size_t i = 0; i < solution.inliers.size(); i++)
    if (watched_.tracks.observations[i].camera == 4 && watched_.good[i]) good++, wrong += !solution.inliers[i];
  EXPECT_LT(wrong, good / 20);
  EXPECT_NEAR(solution.sigma, 0.2, 0.03);
}

struct Chosen {
  AdjustmentOptions options;
  std::vector<ModelTrial> trials;
};

// Starts near the truth, as after a first adjustment.
Chosen choose(double focal_spread, double centre_spread) {
  sim::ArrayOptions array;
  array.rows = array.columns = 4;
  array.focal_spread = focal_spread, array.centre_spread = centre_spread;
  array.k1_spread = array.k2_spread = 0;
  const Rig truth = sim::make_array(array, 1);
  const sim::Watched watched = sim::watch(truth, {.positions = 150, .noise = 0.1}, 2);
  Reconstruction scene = sim::true_scene(truth, watched, {});
  Chosen chosen;
  apply_model({2, true}, chosen.options);
  choose_shared_terms(scene, watched.tracks, chosen.options, chosen.trials);
  return chosen;
}

TEST(ModelChoice, EqualLensesAreShared) {
  const Chosen chosen = choose(0, 0);
  EXPECT_TRUE(chosen.options.shared[kF]);
  EXPECT_TRUE(chosen.options.shared[kCx] && chosen.options.shared[kCy]);
  ASSERT_EQ(chosen.trials.size(), 3u);
  EXPECT_TRUE(chosen.trials[0].chosen);
}

TEST(ModelChoice, DifferentFocalLengthsAndPrincipalPointsAreFree) {
  const Chosen focal = choose(0.02, 0), both = choose(0.02, 20);
  EXPECT_FALSE(focal.options.shared[kF] || both.options.shared[kF]);
  EXPECT_TRUE(focal.options.shared[kCx] && focal.options.shared[kCy]);
  EXPECT_FALSE(both.options.shared[kCx] || both.options.shared[kCy]);
}

// Starts at the truth except for lens terms, so that only missing terms contradict a model.
ModelChoice choose_terms(const sim::ArrayOptions& array, Reconstruction* found = nullptr) {
  const Rig truth = sim::make_array(array, 1);
  const sim::Watched watched = sim::watch(truth, {.bar = 0.3}, 2);
  Reconstruction scene = sim::true_scene(truth, watched, {});
  for (CameraState& camera : scene.cameras) camera.lens_terms()[kK1] = camera.lens_terms()[kK2] = 0;
  const ModelChoice choice = choose_distortion(scene, watched.tracks, {}, watched.tracks.observations.size());
  if (found) *found = scene;
  return choice;
}

sim::ArrayOptions array_with(double k1, double k1_spread) {
  sim::ArrayOptions array;
  array.rows = array.columns = 4;
  array.k1 = k1, array.k1_spread = k1_spread;
  array.k2 = array.k2_spread = 0;
  return array;
}

TEST(ModelChoice, SelectsOneSharedTerm) {
  Reconstruction scene;
  const ModelChoice choice = choose_terms(array_with(-0.15, 0), &scene);
  EXPECT_EQ(choice.model, (DistortionModel{1, true}));
  for (const CameraState& camera : scene.cameras) {
    EXPECT_NEAR(camera.lens_terms()[kK1], -0.15, 0.03);
    EXPECT_EQ(camera.lens_terms()[kK2], 0);
  }
}

TEST(ModelChoice, SelectsNoTermOrOnePerCamera) {
  EXPECT_EQ(choose_terms(array_with(0, 0)).model, (DistortionModel{0, false}));
  EXPECT_EQ(choose_terms(array_with(-0.15, 0.1)).model, (DistortionModel{1, false}));
}

TEST(ModelChoice, TableListsAllModels) {
  const ModelChoice choice = choose_terms(array_with(-0.15, 0));
  ASSERT_EQ(choice.trials.size(), 5u);
  int chosen = 0;
  for (const ModelTrial& trial : choice.trials) chosen += trial.chosen;
  EXPECT_EQ(chosen, 1);
  EXPECT_EQ(choice.trials[0].model, "none");
  EXPECT_TRUE(choice.trials[1].chosen);
  EXPECT_LT(choice.trials[1].bic, choice.trials[0].bic);
  EXPECT_LT(*choice.trials[1].transfer_px, *choice.trials[0].transfer_px);
}

TEST(ModelChoice, FreeTermsOfEachModel) {
  AdjustmentOptions options;
  apply_model({1, true}, options);
  EXPECT_EQ(options.free, (std::array<bool, kNumLensTerms>{true, true, true, true, false}));
  EXPECT_TRUE(options.shared[kK1]);
  EXPECT_FALSE(options.shared[kF]);
  apply_model({2, false}, options);
  EXPECT_TRUE(options.free[kK2]);
  EXPECT_FALSE(options.shared[kK1]);
}

}  // namespace
}  // namespace lf
