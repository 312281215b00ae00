// SPDX-License-Identifier: LGPL-2.1-or-later
#include "quality/camera_turns.h"

#include <algorithm>
#include <cmath>

#include <gtest/gtest.h>

#include "scene/scene.h"

namespace lf {
namespace {

using Came = CameraTurns::Came;

class CameraTurnsTest : public testing::Test {
 protected:
  CameraTurnsTest() {
    shown_.view = {.width = 64, .height = 48, .lens = Lens::pinhole(50, 31.5, 23.5), .pose = {}, .focus = {}};
    shown_.view.focus.plane = focal_plane_at(shown_.view.pose, kSceneMiddle);
  }
  CoveredPicture picture(const ViewRequest& probe, double gain = 1) const {
    const View& view = probe.view;
    CoveredPicture picture{render_scene({view.width, view.height, view.lens, view.pose}, 0), {}};
    for (uint8_t& value : picture.rgb.data()) value = static_cast<uint8_t>(std::min(255., std::round(gain * value)));
    picture.coverage.assign(static_cast<size_t>(view.width) * view.height, 1);
    return picture;
  }
  // One turn of the next camera, whose own picture is that many times as bright.
  Came turn(const CameraProbe& probe, double gain = 1) {
    EXPECT_TRUE(turns_.expects(probe.seen));
    EXPECT_EQ(turns_.take(probe.seen, picture(probe.seen, gain)), Came::kHalf);
    EXPECT_TRUE(turns_.expects(probe.predicted));
    return turns_.take(probe.predicted, picture(probe.predicted));
  }

  const Rig rig_ = scene_rig(3, 3, 80, 60);
  ViewRequest shown_;
  CameraTurns turns_;
};

TEST_F(CameraTurnsTest, LostProbesAreWaitedForAWhile) {
  ASSERT_TRUE(turns_.next(rig_, shown_, 1));
  for (unsigned i = 0; i < CameraTurns::kPatience; i++) EXPECT_FALSE(turns_.next(rig_, shown_, 1)) << i;
  EXPECT_TRUE(turns_.next(rig_, shown_, 1));
  turns_.lose();
  EXPECT_TRUE(turns_.next(rig_, shown_, 1));
}

TEST_F(CameraTurnsTest, ProbesThatAreNotOfTheTurn) {
  ViewRequest other;
  EXPECT_FALSE(turns_.expects(other)) << "nothing is asked";
  const auto probe = turns_.next(rig_, shown_, 1);
  ASSERT_TRUE(probe);
  other = probe->seen;
  other.view.pose.position.x += 1;
  EXPECT_FALSE(turns_.expects(other)) << "somebody else's";
  EXPECT_TRUE(turns_.expects(probe->seen)) << "that changes nothing";
  EXPECT_FALSE(turns_.expects(probe->predicted)) << "there is nothing to compare it with";
  EXPECT_FALSE(turns_.expects(probe->seen)) << "the turn is over";
  EXPECT_EQ(turns_.monitor()->turns(), 0u);
}

TEST_F(CameraTurnsTest, AnotherRigIsWatchedFromTheBeginning) {
  turn(*turns_.next(rig_, shown_, 1));
  EXPECT_EQ(turns_.monitor()->turns(), 1u);
  EXPECT_TRUE(turns_.next(scene_rig(2, 2, 80, 60), shown_, 1));
  EXPECT_EQ(turns_.monitor()->cameras(), 4u);
  EXPECT_EQ(turns_.monitor()->turns(), 0u);
}

// The scene is known to the last bit here, so that all other cameras are predicted without any error.
TEST_F(CameraTurnsTest, ADarkerCameraComesToBeSuspected) {
  constexpr CameraIndex kDark = 4;
  Came latest = Came::kTurn;
  for (size_t i = 0; i < 4 * rig_.cameras.size() && latest != Came::kOtherSuspects; i++) {
    const auto probe = turns_.next(rig_, shown_, 1);
    ASSERT_TRUE(probe);
    latest = turn(*probe, probe->camera == kDark ? 0.8 : 1);
  }
  EXPECT_EQ(latest, Came::kOtherSuspects);
  EXPECT_EQ(turns_.monitor()->suspects(),
            std::vector<CameraMonitor::Suspect>({{kDark, CameraMonitor::Fault::kColour}}));
}

}  // namespace
}  // namespace lf
