// SPDX-License-Identifier: LGPL-2.1-or-later
#include "composite/view_coverage.h"

#include <gtest/gtest.h>

#include "scene/scene.h"

namespace lf {
namespace {

// Of a view that moves away from the array less and less is seen.
TEST(ViewCoverage, AViewThatMovesIsLookedAtNowAndThenUnlessItIsToBeExact) {
  const Rig rig = scene_rig(3, 3, 80, 60);
  ViewRequest request;
  request.view = {.width = 64, .height = 48, .lens = Lens::pinhole(200, 31.5, 23.5), .pose = {}, .focus = {}};
  request.view.focus.plane = focal_plane_at(request.view.pose, kSceneMiddle);
  ViewCoverage coverage;
  const double inside = coverage.share(rig, request, {}, false, 1);
  EXPECT_GT(inside, 0.5);
  EXPECT_LE(inside, 1);
  request.view.pose.position.x = 100;
  EXPECT_EQ(coverage.share(rig, request, {}, false, ViewCoverage::kInterval), inside);
  EXPECT_EQ(coverage.share(rig, request, {}, true, ViewCoverage::kInterval), 0);
  request.view.pose.position.x = 0;
  EXPECT_EQ(coverage.share(rig, request, {}, false, 2 * ViewCoverage::kInterval), inside);

  EXPECT_LT(coverage.share(rig, request, {4}, true, 2 * ViewCoverage::kInterval), 0.5) << "what the middle one gives";
  for (CameraIndex i = 0; i < rig.cameras.size(); i++) request.out_of_service.push_back(i);
  EXPECT_EQ(coverage.share(rig, request, {}, true, 2 * ViewCoverage::kInterval), 0) << "nobody is left";
  coverage.clear();
  request.out_of_service.clear();
  EXPECT_EQ(coverage.share(rig, request, {}, false, 1), inside);
}

}  // namespace
}  // namespace lf
