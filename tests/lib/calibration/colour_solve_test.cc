// SPDX-License-Identifier: LGPL-2.1-or-later
#include "calibration/colour_solve.h"

#include "scene/calibration_targets.h"
#include "scene/scene.h"
#include "support/expect_error.h"
#include "support/test.h"

namespace lf {
namespace {

// Returns the output of a faulty camera for a level of the scene, in double precision and without noise.
Vec3 seen_by(const ColourFault& fault, const Vec3& level, double r2) {
  Vec3 out;
  const double share = 1 + fault.vignetting[0] * r2 + fault.vignetting[1] * r2 * r2;
  for (int c = 0; c < 3; c++) {
    double light = 0;
    for (int k = 0; k < 3; k++) light += fault.crosstalk[3 * c + k] * std::pow(level[k] / 255, 2);
    out[c] = fault.black[c] +
             (255 - fault.black[c]) * fault.gain * fault.balance[c] * std::pow(share * light, 1 / fault.gamma);
  }
  return out;
}

// A recording of a chart at `places` positions, 24 colours each, seen by all cameras with the noise of a mean over 150
// pixels.
struct Recording {
  Rig rig = scene_rig(3, 3, 320, 240);
  std::vector<ColourFault> faults = std::vector<ColourFault>(9);
  int places = 12;
  double noise = 0.25;

  ColourSamples samples(uint32_t seed = 1) const {
    std::mt19937 random(seed);
    std::normal_distribution<double> normal;
    std::uniform_real_distribution<double> u(0, 1);
    ColourSamples out;
    out.cameras = rig.cameras.size();
    out.chart_columns = 6;
    out.chart_rows = 4;
    std::vector<Vec3> chart;
    for (int i = 0; i < 24; i++) {
      const double grey = 25 + 215 * u(random);
      chart.push_back(
          glm::clamp(Vec3(grey + 70 * (u(random) - 0.5), grey + 70 * (u(random) - 0.5), grey + 70 * (u(random) - 0.5)),
                     Vec3(8), Vec3(250)));
    }
    for (int place = 0; place < places; place++) {
      const Vec2 middle(40 + 240 * u(random), 30 + 180 * u(random));
      const double light = 0.75 + 0.25 * u(random);
      for (int patch = 0; patch < 24; patch++, out.patches++) {
        const Vec3 level = light * chart[static_cast<size_t>(patch)];
        const Vec2 on_chart(22 * (patch % 6) - 55, 22 * (patch / 6) - 33);
        for (size_t i = 0; i < rig.cameras.size(); i++) {
          const Camera& camera = rig.cameras[i];
          const Vec2 at = middle + on_chart - 250.0 * Vec2(camera.pose.position.x, camera.pose.position.y);
          if (at.x < 5 || at.y < 5 || at.x > 315 || at.y > 235) continue;
          const VignettingField field(320, 240, camera.principal_point());
          ColourSample sample{.camera = static_cast<CameraIndex>(i), .patch = out.patches, .place = at, .sigma = 0.4};
          const Vec3 seen = seen_by(faults[i], level, field.square(at.x, at.y));
          for (int c = 0; c < 3; c++) {
            sample.level[c] = std::clamp(seen[c] + noise * normal(random), 0.0, 255.0);
            sample.usable[static_cast<size_t>(c)] = seen[c] > 8 && seen[c] < 246;
          }
          out.all.push_back(sample);
        }
      }
    }
    return out;
  }
};

bool has(const ColourSolution& solution, const std::string& code, const std::vector<std::string>& facts) {
  return std::ranges::any_of(solution.findings, [&](const Finding& finding) {
    return finding.code == code && testing::Value(finding.text, mentions(facts));
  });
}

TEST(ColourSolve, CorrectsAllFaults) {
  const Recording recording{.faults = random_faults(9, 3)};
  const ColourSolution solution = solve_colours(recording.rig, recording.samples());
  EXPECT_GT(solution.before.median, 5);
  EXPECT_LE(solution.after.median, 1);
  EXPECT_LE(solution.after.p95, 3);
  EXPECT_TRUE(solution.terms.balance);
  EXPECT_TRUE(solution.terms.vignetting);
  for (const auto& model : solution.models) ASSERT_TRUE(model);
  EXPECT_TRUE(solution.findings.empty()) << solution.findings[0].text;
}

TEST(ColourSolve, EstimatesVignettingToTwoPercent) {
  Recording recording{.faults = random_faults(9, 4)};
  for (ColourFault& fault : recording.faults) fault.vignetting = {-0.25, -0.05};
  const ColourSolution solution = solve_colours(recording.rig, recording.samples());
  for (size_t i = 0; i < 9; i++)
    for (double r2 = 0; r2 <= 1; r2 += 0.1) {
      const double factor = level_factor(vignetting_factor(*solution.models[i], r2));
      const double truth = std::pow(1 - 0.25 * r2 - 0.05 * r2 * r2, -1 / recording.faults[i].gamma);
      EXPECT_NEAR(factor / truth, 1, 0.02) << "camera " << i << ", r^2 " << r2;
    }
}

TEST(ColourSolve, SelectsNoMoreTermsThanFaults) {
  Recording recording;
  ColourSolution solution = solve_colours(recording.rig, recording.samples());
  EXPECT_EQ(solution.terms, ColourTerms());
  for (const auto& model : solution.models)
    EXPECT_NEAR(corrected(*model, {128, 128, 128}).y, 128, 0.3) << "identity";
  for (size_t i = 0; i < 9; i++) recording.faults[i].gain = i % 4 == 0 ? 1.1 : 1;
  solution = solve_colours(recording.rig, recording.samples());
  EXPECT_EQ(solution.terms, ColourTerms()) << solution.terms.name();
  EXPECT_LE(solution.after.p95, 1.5);
  for (size_t i = 0; i < 9; i++) recording.faults[i].balance = {1 + 0.01 * static_cast<double>(i), 1, 1};
  solution = solve_colours(recording.rig, recording.samples());
  EXPECT_EQ(solution.terms, (ColourTerms{.balance = true})) << solution.terms.name();
}

TEST(ColourSolve, MeanCorrectionIsNeutral) {
  Recording recording{.faults = random_faults(9, 5, {.vignetting = 0})};
  // A fault that all cameras share is part of the array's colours.
  for (ColourFault& fault : recording.faults) fault.gain *= 0.8, fault.balance.x *= 1.1;
  const ColourSolution solution = solve_colours(recording.rig, recording.samples());
  for (const double level : {60.0, 120.0, 200.0}) {
    Vec3 mean(0);
    for (const auto& model : solution.models) mean += corrected(*model, Vec3(level)) / 9.0;
    for (int c = 0; c < 3; c++) EXPECT_NEAR(mean[c] / level, 1, 0.03) << level << ", channel " << c;
  }
}

TEST(ColourSolve, NamesCamerasWithAStuckExposure) {
  Recording recording{.faults = random_faults(9, 6)};
  recording.faults[5].gain = kStuckGain;
  const ColourSolution solution = solve_colours(recording.rig, recording.samples());
  for (size_t i = 0; i < 9; i++) EXPECT_EQ(solution.cameras[i].is_stuck, i == 5) << i;
  EXPECT_TRUE(has(solution, "stuck-exposure", {"camera 5", "cam_01_02", "exposure"}));
  EXPECT_TRUE(has(solution, "stuck-exposure", {"%", "clipped"}));
  EXPECT_GT(solution.cameras[5].clipped, 0.2);
  EXPECT_LE(solution.after.median, 1) << "other cameras unaffected";
  EXPECT_LE(solution.after.p95, 3);
  double mean = 0;
  for (size_t i = 0; i < 9; i++)
    if (i != 5) mean += std::log(solution.cameras[i].gain) / 8;
  EXPECT_NEAR(mean, 0, 0.03);
}

TEST(ColourSolve, DarkCamerasHaveMoreNoise) {
  Recording recording;
  recording.faults[2].gain = 0.5;
  const ColourSolution solution = solve_colours(recording.rig, recording.samples());
  EXPECT_TRUE(has(solution, "stuck-exposure", {"camera 2"}));
  EXPECT_TRUE(has(solution, "stuck-exposure", {"noise", "2.0"}));
}

TEST(ColourSolve, IsRobustToOutliers) {
  const Recording recording{.faults = random_faults(9, 7)};
  ColourSamples samples = recording.samples();
  std::mt19937 random(8);
  // One sample in 20 is arbitrary, as with a hand in front of the chart or specular reflections.
  for (ColourSample& sample : samples.all)
    if (random() % 20 == 0)
      for (int c = 0; c < 3; c++) sample.level[c] = 10.0 + random() % 230;
  const ColourSolution solution = solve_colours(recording.rig, samples);
  EXPECT_LE(solution.after.median, 1);
}

TEST(ColourSolve, CamerasWithFewSamplesAreNamedAndNotCorrected) {
  Recording recording;
  recording.faults[7].gain = 0.02;
  ColourSamples samples = recording.samples();
  size_t kept = 0;
  std::erase_if(samples.all, [&](const ColourSample& sample) { return sample.camera == 3 && kept++ >= 5; });
  const ColourSolution solution = solve_colours(recording.rig, samples);
  EXPECT_FALSE(solution.models[3]);
  EXPECT_FALSE(solution.models[7]);
  EXPECT_TRUE(has(solution, "few-samples", {"camera 3", "cam_01_00", "5 places"}));
  EXPECT_TRUE(has(solution, "black-camera", {"camera 7", "cam_02_01", "black"}));
  EXPECT_TRUE(solution.models[0]);
}

TEST(ColourSolve, NoCommonPatchesAreAnError) {
  const Recording recording;
  EXPECT_ERROR(solve_colours(recording.rig, {.cameras = 9}), "0 of 9", "samples");
}

}  // namespace
}  // namespace lf
