// SPDX-License-Identifier: LGPL-2.1-or-later

#include <nlohmann/json.hpp>

#include "base/text.h"
#include "calibration/multiview_geometry.h"
#include "calibration/report.h"
#include "calibration/simulator.h"
#include "support/test.h"

namespace lf {
namespace {

// Two cameras side by side that look along z, and four lights 2 m away; the last light was not detected.
class ReportTest : public testing::Test {
 protected:
  ReportTest() {
    for (const double x : {-0.1, 0.1}) {
      CameraState camera;
      camera.set_lens(Lens::pinhole(200, 80, 60));
      camera.set_pose({{x, 0, 0}, {1, 0, 0, 0}});
      camera.width = 160, camera.height = 120;
      camera.used = true;
      solution_.scene.cameras.push_back(camera);
    }
    tracks_.cameras = {{7, 160, 120}, {9, 160, 120}};
    tracks_.num_positions = 4;
    for (uint32_t j = 0; j < 4; j++) {
      TargetState target;
      target.v = {0.1 * j, 0, 2};
      if (j < 3) target.kind = TargetState::Kind::kPoint;
      solution_.scene.targets.push_back(target);
      for (uint32_t i = 0; i < 2; i++)
        tracks_.observations.push_back(
            {i, j, 0, solution_.scene.cameras[i].lens().project(Vec3(0.1 * j + (i == 0 ? 0.1 : -0.1), 0, 2)).value()});
    }
    // Lengths: 3, 4 | 0, 5 | 0, 100 (an outlier).
    tracks_.observations[0].pixel.x += 3;
    tracks_.observations[1].pixel.y -= 4;
    tracks_.observations[3].pixel += Vec2(3, 4);
    tracks_.observations[5].pixel.x += 100;
    solution_.inliers = {1, 1, 1, 1, 1, 0, 1, 1};
    solution_.sigma = 0.25;
    solution_.expected_rms = 0.3;
  }
  Tracks tracks_;
  Solution solution_;
};

TEST_F(ReportTest, HasFiguresOfTheArrayAndOfEachCamera) {
  const auto report = calibration_report(solution_, tracks_, {{}, "the pitch"}, {});
  EXPECT_EQ(report["format"], "lightfield-calibration");
  EXPECT_EQ(report["observations"], 8);
  EXPECT_EQ(report["unplaced"], 2);
  EXPECT_EQ(report["outliers"], 1);
  EXPECT_NEAR(report["mean_px"], 112 / 6., 1e-9);
  EXPECT_NEAR(report["median_px"], 4, 1e-9);
  EXPECT_NEAR(report["rms_px"], std::sqrt((9 + 16 + 25 + 1e4) / 6.), 1e-9);
  EXPECT_EQ(report["inliers"]["observations"], 5);
  EXPECT_NEAR(report["inliers"]["mean_px"], 12 / 5., 1e-9);
  EXPECT_NEAR(report["inliers"]["median_px"], 3, 1e-9);
  EXPECT_EQ(report["sigma_px"], 0.25);
  EXPECT_EQ(report["expected_rms_px"], 0.3);
  EXPECT_EQ(report["scale_from"], "the pitch");
  EXPECT_FALSE(report.contains("disagreement_of_halves"));
  ASSERT_EQ(report["cameras"].size(), 2u);
  EXPECT_EQ(report["cameras"][0]["id"], 7);
  EXPECT_EQ(report["cameras"][0]["outliers"], 0);
  EXPECT_NEAR(report["cameras"][0]["rms_px"], std::sqrt(9 / 3.), 1e-9);
  EXPECT_EQ(report["cameras"][1]["id"], 9);
  EXPECT_EQ(report["cameras"][1]["observations"], 4);
  EXPECT_EQ(report["cameras"][1]["outliers"], 1);
  EXPECT_NEAR(report["cameras"][1]["rms_px"], std::sqrt(41 / 2.), 1e-9);
}

TEST_F(ReportTest, NamesCamerasThatWereNotFound) {
  solution_.scene.cameras[1].used = false;
  const auto report = calibration_report(solution_, tracks_, {}, {});
  EXPECT_TRUE(report["cameras"][0]["found"]);
  EXPECT_FALSE(report["cameras"][1]["found"]);
  EXPECT_EQ(report["cameras"][1]["rms_px"], 0);
  EXPECT_EQ(report["unplaced"], 5);
}

TEST_F(ReportTest, HasModelsAndFindings) {
  solution_.distortion = {1, false};
  solution_.trials = {{"none", 120, std::nullopt, false}, {"k1", 100, 0.4, true}};
  solution_.disagreement = 1.5;
  using enum Finding::Severity;
  const auto report =
      calibration_report(solution_, tracks_, {}, {{kNote, "a", "one"}, {kWarning, "b", "two"}, {kError, "c", "three"}});
  EXPECT_EQ(report["model"], solution_.distortion.name());
  EXPECT_EQ(report["disagreement_of_halves"], 1.5);
  ASSERT_EQ(report["models"].size(), 2u);
  EXPECT_TRUE(report["models"][0]["transfer_px"].is_null());
  EXPECT_EQ(report["models"][1]["transfer_px"], 0.4);
  EXPECT_EQ(report["models"][1]["chosen"], true);
  ASSERT_EQ(report["findings"].size(), 3u);
  const char* const severities[] = {"note", "warning", "error"};
  for (int i = 0; i < 3; i++) EXPECT_EQ(report["findings"][i]["severity"], severities[i]);
  EXPECT_EQ(report["findings"][1]["code"], "b");
  EXPECT_EQ(report["findings"][2]["text"], "three");
}

TEST_F(ReportTest, EmptySolutionHasFiniteFigures) {
  for (CameraState& camera : solution_.scene.cameras) camera.used = false;
  const auto report = calibration_report(solution_, tracks_, {}, {});
  EXPECT_EQ(report["mean_px"], 0);
  EXPECT_EQ(report["median_px"], 0);
  EXPECT_EQ(report["rms_px"], 0);
  EXPECT_EQ(report["unplaced"], 8);
}

constexpr double kBar = 0.3;
constexpr uint64_t kArrays = 6;

struct Solved {
  Rig truth;
  Solution solution;
  Placement placement;
};

Solved solve(uint64_t seed, double bar) {
  Solved s{sim::make_array({.rows = 3, .columns = 3}, seed), {}, {}};
  const Tracks tracks = sim::watch(s.truth, {.bar = bar}, seed + 100).tracks;
  // The estimated model errors are valid only if the model is correct.
  const SolveOptions options{.distortion = DistortionModel{2, false}};
  s.solution = solve_tracks(tracks, options);
  s.placement = place_solution(s.solution, tracks, options, {.bar_length = bar});
  return s;
}

// Arrays solved with a bar, once for all tests.
const std::vector<Solved>& arrays() {
  static const std::vector<Solved> all = [] {
    std::vector<Solved> list;
    for (uint64_t seed = 1; seed <= kArrays; seed++) list.push_back(solve(seed, kBar));
    return list;
  }();
  return all;
}

const SoftMode* find(const std::vector<SoftMode>& modes, const std::string& code) {
  for (const SoftMode& mode : modes)
    if (mode.code == code) return &mode;
  return nullptr;
}

TEST(SoftModes, OneLightLeavesTheDepthUncertain) {
  const Solved one = solve(1, 0);
  const Solved& bar = arrays()[0];
  const auto loose = soft_modes(one.solution, one.placement), firm = soft_modes(bar.solution, bar.placement);
  ASSERT_TRUE(find(loose, "depth") && find(firm, "depth"));
  EXPECT_TRUE(find(loose, "depth")->is_soft());
  EXPECT_FALSE(find(firm, "depth")->is_soft());
  EXPECT_LT(find(firm, "depth")->sigma, 0.5 * find(loose, "depth")->sigma);
  for (const char* code : {"gaze", "toe-in", "bow", "proportions", "places", "directions"})
    EXPECT_TRUE(find(firm, code)) << code;
  for (size_t i = 1; i < loose.size(); i++)
    EXPECT_GE(loose[i - 1].sigma / loose[i - 1].limit, loose[i].sigma / loose[i].limit);
}

TEST(SoftModes, FocalLengthErrorsMatchThePrediction) {
  double squares = 0;
  for (const Solved& s : arrays()) {
    double error = 0;
    for (size_t i = 0; i < 9; i++) {
      const double f = s.truth.cameras[i].lens.fx();
      error += (s.solution.scene.cameras[i].lens_terms()[kF] / f - 1) / 9;
    }
    squares += std::pow(100 * error / find(soft_modes(s.solution, s.placement), "depth")->sigma, 2) / kArrays;
  }
  EXPECT_GT(std::sqrt(squares), 0.4);
  EXPECT_LT(std::sqrt(squares), 2);
}

// Points 1.5 m away, seen without noise by all cameras but one, and predicted in that camera.
double squared_transfer(const Solved& s) {
  double sum = 0, count = 0;
  for (size_t of = 0; of < 9; of++)
    for (const Vec2& place : {Vec2(160, 120), Vec2(80, 60), Vec2(240, 168)}) {
      const Camera& camera = s.truth.cameras[of];
      const Vec3 direction = camera.pose.rotation() * Vec3(*camera.lens.unproject(place), 1);
      const Vec3 point = camera.pose.position + direction * ((1.5 - camera.pose.position.z) / direction.z);
      Tracks tracks;
      std::vector<uint32_t> seen;
      for (uint32_t i = 0; i < 9; i++)
        if (const auto pixel = s.truth.cameras[i].lens.project(s.truth.cameras[i].pose.camera_from_world(point))) {
          if (i != of) seen.push_back(static_cast<uint32_t>(tracks.observations.size()));
          tracks.observations.push_back({i, 0, 0, *pixel});
        }
      const auto predicted = triangulate(s.solution.scene.cameras, tracks, seen, 4);
      if (!predicted) continue;
      TargetState target;
      target.kind = TargetState::Kind::kPoint;
      for (int k = 0; k < 3; k++) target.v[k] = predicted->point[k];
      const auto e = residual(s.solution.scene.cameras[of], target, tracks.observations[of]);
      if (e) sum += glm::dot(*e, *e), count++;
    }
  return sum / count;
}

TEST(ProjectionErrors, MatchThePrediction) {
  double seen = 0, foretold = 0;
  for (const Solved& s : arrays()) {
    seen += squared_transfer(s) / kArrays;
    const auto errors = projection_errors(s.solution, s.placement);
    ASSERT_GT(errors.size(), 5u);
    double nearest = 1e9, squared = 0;
    for (const ProjectionError& error : errors) {
      EXPECT_GE(error.worst, error.middle);
      if (std::abs(error.depth - 1.5) < nearest)
        nearest = std::abs(error.depth - 1.5), squared = error.middle * error.middle;
    }
    foretold += squared / kArrays;
  }
  EXPECT_GT(std::sqrt(seen / foretold), 0.6);
  EXPECT_LT(std::sqrt(seen / foretold), 1.7);
}

TEST(ProjectionErrors, CoverDepthsBeyondTheLights) {
  const Solved& s = arrays()[1];
  const LightRange range = light_range(s.solution, s.placement);
  EXPECT_GT(range.near, 0.6);
  EXPECT_LT(range.far, 3.4);
  const auto errors = projection_errors(s.solution, s.placement);
  ASSERT_FALSE(errors.empty());
  EXPECT_LT(errors.front().depth, range.near);
  EXPECT_GT(errors.back().depth, range.far);
}

}  // namespace
}  // namespace lf
