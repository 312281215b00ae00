// SPDX-License-Identifier: LGPL-2.1-or-later
#include "focus/focus_still.h"

#include <gtest/gtest.h>

#include "lib/focus/array_of_walls.h"

namespace lf {
namespace {

TEST(FocusStill, FindsWhatAPipelineFinds) {
  const test::ArrayOfWalls walls;
  View view = walls.view(0);
  view.focus.map = nullptr;
  const FocusControl::Settings settings{FocusMode::kSurface, 1.2, 6};
  const auto images = [&](CameraIndex camera) -> const Image& { return walls.images[camera]; };
  const View focused = focus_still(walls.rig, walls.mesh, view, images, settings, 9);

  FocusControl control(settings);
  const FocusArray array(walls.rig);
  ViewRequest request;
  request.view = view;
  for (int i = 0; i < 10; i++) {
    std::vector<Moments> moments;
    if (!request.trials.empty()) moments = walls.moments(request.view, request.trials, walls.own);
    const FocusControl::Plan plan = control.next(request, moments, array);
    request.view = plan.view;
    request.trials = plan.trials;
    request.on_plane = plan.on_plane;
    request.view.focus.plane = plan.plane.value_or(view.focus.plane);
  }
  EXPECT_FALSE(request.on_plane);
  ASSERT_TRUE(focused.focus.map);
  EXPECT_EQ(focused.focus.map->levels, request.view.focus.map->levels);
  EXPECT_EQ(focus_still(walls.rig, walls.mesh, view, images, {}).focus.map, nullptr) << "a plane stays a plane";
}

}  // namespace
}  // namespace lf
