// SPDX-License-Identifier: LGPL-2.1-or-later
#include "view/tour.h"

#include <gtest/gtest.h>

#include "render/contribution_map.h"
#include "support/expect_error.h"

namespace lf {
namespace {

// In the plane z = 0 looking along +z, pitch 0.1 m.
Rig grid(int rows, int columns) {
  Rig rig;
  for (int i = 0; i < rows * columns; i++) {
    Camera camera;
    camera.id = static_cast<uint32_t>(i);
    camera.width = 64;
    camera.height = 48;
    camera.lens = Lens::pinhole(60, 31.5, 23.5);
    camera.pose.position = {0.1 * (i % columns), 0.1 * (i / columns), 0};
    rig.cameras.push_back(camera);
  }
  rig.topology = {Topology::Type::kGrid, rows, columns, {}};
  return rig;
}

double focus_depth(const View& view) { return -view.focus.plane.d / view.focus.plane.normal.z; }

TEST(Tour, BeginsAndEndsInTheMiddleWithTheNearFocus) {
  const std::vector<NamedView> views = make_tour(grid(5, 5), {2, 6}, {.frames = 60, .rate_hz = 15});
  ASSERT_EQ(views.size(), 60u);
  EXPECT_EQ(views[1].time, 1 / 15.0);
  for (const View* view : {&views.front().view, &views.back().view}) {
    EXPECT_NEAR(glm::length(view->pose.position - Vec3(0.2, 0.2, 0)), 0, 1e-9);
    EXPECT_NEAR(focus_depth(*view), 2, 1e-9);
    EXPECT_EQ(view->width, 64);
    EXPECT_EQ(view->height, 48);
  }
}

TEST(Tour, GoesToTheFarFocusSmoothly) {
  const std::vector<NamedView> views = make_tour(grid(5, 5), {2, 6}, {.frames = 200});
  double farthest = 0, nearest = 1e9, longest_step = 0;
  for (size_t i = 0; i < views.size(); i++) {
    farthest = std::max(farthest, focus_depth(views[i].view));
    nearest = std::min(nearest, focus_depth(views[i].view));
    if (i > 0)
      longest_step = std::max(longest_step, glm::length(views[i].view.pose.position - views[i - 1].view.pose.position));
  }
  EXPECT_NEAR(farthest, 6, 0.6);
  EXPECT_NEAR(nearest, 2, 0.2);
  EXPECT_LT(longest_step, 0.03);
}

TEST(Tour, TheArrayCoversEveryView) {
  // Far focus, so that no camera's own field of view ends before the array does.
  for (const auto& [rows, columns] : {std::pair{5, 5}, {3, 9}, {1, 6}, {1, 2}}) {
    const Rig rig = grid(rows, columns);
    const Mesh mesh = build_mesh(rig);
    for (const NamedView& view : make_tour(rig, {50, 80}, {.frames = 15})) {
      const ViewPlan plan(rig, mesh, view.view);
      const std::vector<float> coverage = view_coverage(rig, plan, OwnerMap(plan, {0, 0, 64, 48}));
      for (const float c : coverage) ASSERT_GT(c, 0.999f) << rows << "x" << columns << " at " << view.time;
    }
  }
}

TEST(Tour, ASingleCameraOnlyRefocuses) {
  for (const NamedView& view : make_tour(grid(1, 1), {2, 6}, {.frames = 9}))
    EXPECT_EQ(view.view.pose.position, Vec3(0, 0, 0));
}

TEST(Tour, StillAndOneFrame) {
  for (const NamedView& view : make_tour(grid(2, 2), {1, 2}, {.frames = 5, .still = true})) EXPECT_EQ(view.time, 0);
  const std::vector<NamedView> one = make_tour(grid(2, 2), {1, 2}, {.width = 7, .height = 5, .frames = 1});
  ASSERT_EQ(one.size(), 1u);
  EXPECT_EQ(one[0].view.width, 7);
  EXPECT_EQ(one[0].view.height, 5);
}

TEST(Tour, RefusesImpossibleOptions) {
  EXPECT_ERROR(make_tour(grid(2, 2), {0, 2}, {}), "focus: must be 0 < near <= far");
  EXPECT_ERROR(make_tour(grid(2, 2), {3, 2}, {}), "focus: must be 0 < near <= far");
  EXPECT_ERROR(make_tour(grid(2, 2), {1, 2}, {.frames = 0}), "frames: must be at least 1");
  EXPECT_ERROR(make_tour(grid(2, 2), {1, 2}, {.rate_hz = 0}), "rate: must be positive");
}

}  // namespace
}  // namespace lf
