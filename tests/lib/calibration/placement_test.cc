// SPDX-License-Identifier: LGPL-2.1-or-later
#include "calibration/placement.h"

#include <gtest/gtest.h>

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

}  // namespace
}  // namespace lf
