// SPDX-License-Identifier: LGPL-2.1-or-later
#include "view/view_path.h"

#include <gtest/gtest.h>

#include "base/error.h"
#include "geometry/pose.h"
#include "render/contribution_map.h"
#include "support/expect_error.h"
#include "view/navigator.h"

namespace lf {

namespace {

NamedView key(double time, const Vec3& position, const Euler& degrees, double focus, double fov = 40) {
  Viewpoint v;
  v.pose = {position, quat_from_euler(degrees)};
  v.focus_distance = focus;
  v.fov_y_deg = fov;
  return {"key", time, make_view(v, 320, 240)};
}

std::vector<NamedView> keys() {
  return {key(1, {0, 0, 0}, {0, 0, 0}, 2), key(2, {1, 0, 0}, {20, 5, 0}, 4, 50), key(4, {1, 1, 0}, {-30, 0, 10}, 1),
          key(5, {0, 1, -1}, {170, 0, 0}, 3)};
}

TEST(ViewPath, IsAtEachKeyAtItsTimeAndStaysAtTheEnds) {
  const ViewPath path(keys());
  EXPECT_EQ(path.begin(), 1);
  EXPECT_EQ(path.end(), 5);
  for (const NamedView& k : keys()) {
    const View view = path.at(k.time);
    EXPECT_EQ(view.pose.position, k.view.pose.position);
    EXPECT_NEAR(std::abs(glm::dot(view.pose.orientation, k.view.pose.orientation)), 1, 1e-15);
    EXPECT_EQ(view.lens, k.view.lens);
  }
  EXPECT_EQ(path.at(-3).pose.position, keys().front().view.pose.position);
  EXPECT_EQ(path.at(99).pose.position, keys().back().view.pose.position);
}

TEST(ViewPath, IsSmooth) {
  const ViewPath path(keys());
  // Velocity by differences is continuous: across keys too, it changes by no more than acceleration allows.
  const double h = 1e-4;
  const auto velocity = [&](double t) { return (path.at(t + h).pose.position - path.at(t).pose.position) / h; };
  const auto turn = [&](double t) { return (path.at(t + h).pose.orientation - path.at(t).pose.orientation) / h; };
  for (double t = 1 + h; t < 5 - 3 * h; t += 0.01) {
    EXPECT_LT(glm::length(velocity(t + h) - velocity(t)), 20 * h) << t;
    EXPECT_LT(glm::length(turn(t + h) - turn(t)), 20 * h) << t;
  }
  for (double t : {2.0, 4.0}) {
    EXPECT_LT(glm::length(velocity(t) - velocity(t - h)), 20 * h) << t;
    EXPECT_LT(glm::length(turn(t) - turn(t - h)), 20 * h) << t;
  }
}

TEST(ViewPath, EveryViewIsValidAndItsPlaneFacesIt) {
  const ViewPath path(keys());
  for (double t = 0; t < 6; t += 0.037) {
    const View view = path.at(t);
    validate(view);
    EXPECT_NEAR(glm::length(view.pose.orientation), 1, 1e-14);
    EXPECT_NEAR(glm::dot(view.focus.plane.normal, view.pose.forward()), -1, 1e-12) << t;
  }
}

TEST(ViewPath, FocusMovesLogarithmically) {
  const ViewPath path({key(0, {}, {}, 1), key(2, {}, {}, 16)});
  const View view = path.at(1);
  EXPECT_NEAR(view.focus.plane.signed_distance(view.pose.position), 4, 1e-12);  // not 8.5
}

TEST(ViewPath, AStraightEvenPathStaysStraightAndEven) {
  const ViewPath path({key(0, {0, 0, 0}, {}, 2), key(1, {1, 2, 3}, {}, 2), key(2, {2, 4, 6}, {}, 2)});
  for (double t = 0; t <= 2; t += 0.125)
    EXPECT_LT(glm::length(path.at(t).pose.position - t * Vec3(1, 2, 3)), 1e-14) << t;
}

TEST(ViewPath, PlanesThatStandInTheWorldStay) {
  const Plane wall{{0, 0, -1}, 5};
  std::vector<NamedView> k = keys();
  for (NamedView& view : k) view.view.focus.plane = wall;
  k[2].view.focus.plane = {-wall.normal, -wall.d};  // the same plane
  const ViewPath path(k);
  for (double t = 1; t < 5; t += 0.1) {
    EXPECT_LT(glm::length(path.at(t).focus.plane.normal - wall.normal), 1e-14);
    EXPECT_NEAR(path.at(t).focus.plane.d, 5, 1e-14);
  }
}

TEST(ViewPath, TheSignOfAQuaternionMeansNothing) {
  std::vector<NamedView> flipped = keys();
  flipped[1].view.pose.orientation = -flipped[1].view.pose.orientation;
  const ViewPath a(keys()), b(flipped);
  for (double t = 1; t < 5; t += 0.1)
    EXPECT_NEAR(std::abs(glm::dot(a.at(t).pose.orientation, b.at(t).pose.orientation)), 1, 1e-15);
}

TEST(ViewPath, SamplesIncludeBothEnds) {
  const std::vector<NamedView> views = ViewPath(keys()).sample(15);
  ASSERT_EQ(views.size(), 61u);
  EXPECT_EQ(views.front().name, "view_000000");
  EXPECT_EQ(views.back().name, "view_000060");
  EXPECT_EQ(views[15].time, 2);
  EXPECT_EQ(views.back().view.pose.position, keys().back().view.pose.position);
  EXPECT_EQ(ViewPath({keys()[0]}).sample(30).size(), 1u);
}

TEST(ViewPath, BadKeysAreNamed) {
  const auto text = [](std::vector<NamedView> k) -> std::string {
    try {
      ViewPath path(std::move(k));
    } catch (const Error& e) {
      return e.what();
    }
    return "";
  };
  EXPECT_EQ(text({}), "views: a path needs at least one view");
  std::vector<NamedView> k = keys();
  k[2].time = k[1].time;
  EXPECT_EQ(text(k), "views[2].time: must be later than that of the view before");
  k = keys();
  k[1].view.width = 321;
  EXPECT_EQ(text(k), "views[1].width, height: must be those of the first view");
  k = keys();
  k[3].view.lens = Lens(LensModel::kPinhole, {100, 100, 0, 0});
  EXPECT_EQ(text(k), "views[3].model: must be that of the first view");
  EXPECT_THROW(ViewPath(keys()).sample(0), Error);
}

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

TEST(Tour, TheArrayCoversTheEyesOfASet) {
  for (const auto& [rows, columns] : {std::pair{5, 5}, {3, 9}, {1, 6}}) {
    const Rig rig = grid(rows, columns);
    const Mesh mesh = build_mesh(rig);
    const double width = glm::distance(rig.cameras.front().pose.position, rig.cameras[columns - 1].pose.position);
    for (const double share : {0.2, 0.5}) {
      ViewSet set;
      set.layout = SetLayout::kStereo;
      set.eye_distance = share * width;
      set.converged = false;
      double farthest = 0;
      for (const NamedView& view : make_tour(rig, {50, 80}, {.frames = 15, .room = set.eye_distance})) {
        farthest = std::max(farthest, std::abs(view.view.pose.position.x - rig.cameras[columns / 2].pose.position.x));
        for (const int eye : {0, 1}) {
          const ViewPlan plan(rig, mesh, set.view(view.view, set.place(eye)));
          const std::vector<float> coverage = view_coverage(rig, plan, OwnerMap(plan, {0, 0, 64, 48}));
          for (const float c : coverage) ASSERT_GT(c, 0.999f) << rows << "x" << columns << " at " << view.time;
        }
      }
      EXPECT_GT(farthest, 0.1 * width) << "it still goes somewhere";
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
  EXPECT_ERROR(make_tour(grid(2, 2), {1, 2}, {.room = -1}), "room: must not be negative");
}

TEST(FocusSweep, GoesFromNearToFarEvenInInverseDistance) {
  const View view = key(0, {1, 2, 3}, {20, 5, 0}, 7).view;
  const std::vector<NamedView> views = make_focus_sweep(view, {1.5, 6}, 4);
  ASSERT_EQ(views.size(), 4u);
  for (int i = 0; i < 4; i++) {
    const double distance = 1 / ((3 - i) / 3.0 / 1.5 + i / 3.0 / 6);
    const Vec3 on_axis = view.pose.position + distance * view.pose.forward();
    EXPECT_NEAR(views[i].view.focus.plane.signed_distance(on_axis), 0, 1e-12) << i;
    EXPECT_NEAR(std::abs(glm::dot(views[i].view.focus.plane.normal, view.pose.forward())), 1, 1e-12);
    EXPECT_EQ(views[i].view.pose, view.pose);
  }
  EXPECT_EQ(views[3].name, "view_000003");
  EXPECT_EQ(make_focus_sweep(view, {2, 2}, 1).size(), 1u);
  EXPECT_ERROR(make_focus_sweep(view, {2, 1}, 3), "0 < near <= far");
  EXPECT_ERROR(make_focus_sweep(view, {0, 1}, 3), "0 < near <= far");
  EXPECT_ERROR(make_focus_sweep(view, {1, 2}, 0), "planes: must be at least 1");
}

}  // namespace

}  // namespace lf
