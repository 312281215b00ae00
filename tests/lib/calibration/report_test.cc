// SPDX-License-Identifier: LGPL-2.1-or-later
#include "calibration/report.h"

#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "base/error.h"
#include "calibration/simulator.h"

namespace lf {
namespace {

class PlacementTest : public testing::Test {
 protected:
  // A solution without errors, in a frame and a scale of its own.
  void SetUp() override {
    sim::PathOptions path;
    path.bar = 0.3;
    const sim::Watched watched = sim::watch(truth_, path, 2);
    tracks_ = watched.tracks;
    solution_.scene = sim::true_scene(truth_, watched, {});
    const Similarity moved{1, glm::angleAxis(1.0, Vec3(0, 0.6, 0.8)), {1, 2, 3}};
    for (CameraState& camera : solution_.scene.cameras) camera.set_pose(moved(camera.pose()));
  }
  double distance(const Similarity& s, size_t a, size_t b) {
    return glm::length(s(solution_.scene.cameras[a].pose()).position - s(solution_.scene.cameras[b].pose()).position);
  }
  const Rig truth_ = sim::make_array({}, 1);
  Tracks tracks_;
  Solution solution_;
  const double true_distance_ = glm::length(truth_.cameras[3].pose.position - truth_.cameras[60].pose.position);
};

TEST_F(PlacementTest, EachScale) {
  PlacementOptions bar, pitch, known;
  bar.bar_length = 0.3;
  pitch.pitch = 0.06;
  known.distance = {3, 60, true_distance_};
  EXPECT_NEAR(distance(place_solution(solution_, tracks_, {}, bar).world_from_scene, 3, 60), true_distance_, 1e-9);
  EXPECT_NEAR(distance(place_solution(solution_, tracks_, {}, known).world_from_scene, 3, 60), true_distance_, 1e-9);
  EXPECT_NEAR(distance(place_solution(solution_, tracks_, {}, pitch).world_from_scene, 3, 60), true_distance_, 0.03);
  EXPECT_EQ(place_solution(solution_, tracks_, {}, {}).scale_from, "");
  known.distance->a = 99;
  EXPECT_THROW(place_solution(solution_, tracks_, {}, known), Error);
}

TEST_F(PlacementTest, TheFrameOfThePriorRig) {
  SolveOptions options;
  options.prior = truth_;
  const Rig rig = make_rig(solution_, tracks_, options, place_solution(solution_, tracks_, options, {}));
  for (size_t i = 0; i < rig.cameras.size(); i++)
    EXPECT_LE(glm::length(rig.cameras[i].pose.position - truth_.cameras[i].pose.position), 1e-9);
  EXPECT_EQ(rig.topology.type, Topology::Type::kGrid);
}

TEST_F(PlacementTest, AFrameOfItsOwnLooksAlongZ) {
  const Rig rig = make_rig(solution_, tracks_, {}, place_solution(solution_, tracks_, {}, {}));
  Vec3 mean(0, 0, 0);
  for (const Camera& camera : rig.cameras) mean += camera.pose.position / static_cast<double>(rig.cameras.size());
  EXPECT_LE(glm::length(mean), 1e-9);
  EXPECT_GE(rig.cameras[0].pose.forward().z, 0.99);
  EXPECT_GE(rig.cameras[0].pose.right().x, 0.99);
}

// Two cameras side by side that look along z, and four lights 2 m away; the last was found by nobody.
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

TEST_F(ReportTest, HasTheFiguresOfAllAndOfEach) {
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

TEST_F(ReportTest, NothingFoundIsNoDivisionByZero) {
  for (CameraState& camera : solution_.scene.cameras) camera.used = false;
  const auto report = calibration_report(solution_, tracks_, {}, {});
  EXPECT_EQ(report["mean_px"], 0);
  EXPECT_EQ(report["median_px"], 0);
  EXPECT_EQ(report["rms_px"], 0);
  EXPECT_EQ(report["unplaced"], 8);
}

}  // namespace

}  // namespace lf
