// SPDX-License-Identifier: LGPL-2.1-or-later
#include "view/navigator.h"

#include "geometry/pose.h"
#include "support/rigs.h"
#include "support/test.h"

namespace lf {
namespace {

double distance(const Vec3& a, const Vec3& b) { return glm::length(a - b); }

Viewpoint arbitrary_viewpoint() {
  Viewpoint v;
  v.pose = {{1, -2, 0.5}, quat_from_euler({35, -20, 10})};
  v.fov_y_deg = 40;
  v.focus_distance = 3;
  return v;
}

Rig array(int rows, int columns, double pitch, const Pose& world_from_array) {
  Rig rig = test::camera_grid(rows, columns, pitch, 320, 240, 400);
  const Vec3 middle = rig.cameras.back().pose.position / 2.0;
  for (Camera& camera : rig.cameras) {
    camera.lens = Lens(LensModel::kRadial, {400, 159.5, 119.5, -0.1, 0.01});
    camera.pose = {world_from_array.world_from_camera(camera.pose.position - middle), world_from_array.orientation};
  }
  return rig;
}

TEST(Navigator, OrbitKeepsThePivotAndItsDistance) {
  const Pose home = arbitrary_viewpoint().pose;
  Navigator n(arbitrary_viewpoint());
  const Vec3 pivot = n.pivot();
  n.orbit(0.25, 0);
  EXPECT_LT(distance(n.pivot(), pivot), 1e-14);
  EXPECT_EQ(n.viewpoint().focus_distance, 3);
  const Vec3 before = home.position - pivot, after = n.viewpoint().pose.position - pivot;
  EXPECT_NEAR(glm::dot(before, after) / 9, std::cos(0.25 * kOrbitPerHeight), 1e-14);
  // About the home view's vertical axis: the viewpoint keeps its height, and moves to the left, so that the scene
  // follows the mouse to the right.
  EXPECT_NEAR(glm::dot(after - before, home.down()), 0, 1e-14);
  EXPECT_LT(glm::dot(after - before, home.right()), -0.1);
}

TEST(Navigator, DragAcrossTheViewCrossesTheArray) {
  Navigator n(default_viewpoint(array(1, 2, 1, {})));
  n.orbit(1, 0);
  EXPECT_NEAR(glm::length(n.viewpoint().pose.position), 1, 0.01);
}

TEST(Navigator, OrbitDownLooksFromAbove) {
  Navigator n;
  n.orbit(0, 1);
  EXPECT_LT(n.viewpoint().pose.position.y, -0.1);
  EXPECT_GT(n.viewpoint().pose.forward().y, 0.1);
}

TEST(Navigator, PanMovesPointsInFocusWithTheMouse) {
  Navigator n(arbitrary_viewpoint());
  const View before = make_view(n.viewpoint(), 640, 480);
  const Vec3 x = before.pose.world_from_camera({0.3, -0.2, 3});
  const Vec2 from = *before.lens.project(before.pose.camera_from_world(x));
  n.pan(60 / 480.0, -24 / 480.0);
  const View after = make_view(n.viewpoint(), 640, 480);
  const Vec2 to = *after.lens.project(after.pose.camera_from_world(x));
  EXPECT_NEAR(to.x - from.x, 60, 1e-9);
  EXPECT_NEAR(to.y - from.y, -24, 1e-9);
}

TEST(Navigator, ZoomKeepsThePointUnderThePointer) {
  for (const Vec2 place : {Vec2(0, 0), Vec2(0.5, 0), Vec2(0, -0.4), Vec2(-0.6, 0.45)}) {
    Navigator n;
    const auto ray = [&] {
      const double height = 2 * std::tan(n.viewpoint().fov_y_deg * M_PI / 360);
      return glm::normalize(n.viewpoint().pose.rotation() * Vec3(height * place, 1));
    };
    const Vec3 before = ray();
    for (int i = 0; i < 10; i++) n.zoom(1, place);
    EXPECT_NEAR(n.viewpoint().fov_y_deg, 45 / std::pow(1.05, 10), 1e-12);
    EXPECT_LT(glm::length(ray() - before), place.x * place.y == 0 ? 1e-12 : 0.02) << place.x << " " << place.y;
    EXPECT_NEAR(n.viewpoint().pose.right().y, 0, 1e-12);
    EXPECT_EQ(n.viewpoint().pose.position, n.home().pose.position);
    for (int i = 0; i < 10; i++) n.zoom(-1, place);
    EXPECT_LT(glm::length(n.viewpoint().pose.forward() - n.home().pose.forward()), 0.01);
  }
}

TEST(Navigator, FocusAndZoomAreMultiplicativeAndClamped) {
  Navigator n(arbitrary_viewpoint());
  n.focus(2);
  EXPECT_NEAR(n.viewpoint().focus_distance, 3 * 1.21, 1e-12);
  n.focus(-2);
  EXPECT_NEAR(n.viewpoint().focus_distance, 3, 1e-12);
  EXPECT_EQ(n.viewpoint().pose, Navigator(arbitrary_viewpoint()).viewpoint().pose);
  n.focus(1e5);
  EXPECT_EQ(n.viewpoint().focus_distance, kMaxFocus);
  n.focus(-1e5);
  EXPECT_EQ(n.viewpoint().focus_distance, kMinFocus);
  n.zoom(1);
  EXPECT_NEAR(n.viewpoint().fov_y_deg, 40 / 1.05, 1e-12);
  n.zoom(1e5);
  EXPECT_EQ(n.viewpoint().fov_y_deg, kMinFovDeg);
  n.zoom(-1e5);
  EXPECT_EQ(n.viewpoint().fov_y_deg, kMaxFovDeg);
}

TEST(Navigator, KeysMatchTheDocumentation) {
  struct Row {
    const char *key, *opposite;
    Vec3 moved_towards;  // in the home view's axes; 0: the viewpoint stays
  };
  const Row rows[] = {{"Left", "Right", {1, 0, 0}},
                      {"Up", "Down", {0, 1, 0}},
                      {"w", "s", {0, 0, 1}},
                      {"d", "a", {1, 0, 0}},
                      {"q", "e", {0, 1, 0}},
                      {"W", "S", {0, 0, 1}},
                      {"plus", "minus", {0, 0, 0}},
                      {"bracketleft", "bracketright", {0, 0, 0}},
                      {"KP_Add", "KP_Subtract", {0, 0, 0}}};
  const Pose home = arbitrary_viewpoint().pose;
  for (const Row& row : rows) {
    Navigator n(arbitrary_viewpoint());
    ASSERT_TRUE(n.key(row.key)) << row.key;
    EXPECT_FALSE(n.viewpoint() == n.home()) << row.key;
    const Vec3 moved = n.viewpoint().pose.position - home.position;
    if (row.moved_towards == Vec3(0))
      EXPECT_EQ(glm::length(moved), 0) << row.key;
    else
      EXPECT_GT(glm::dot(glm::normalize(moved), home.rotation() * row.moved_towards), 0.99) << row.key;
    ASSERT_TRUE(n.key(row.opposite)) << row.opposite;
    EXPECT_LT(distance(n.viewpoint().pose.position, home.position), 1e-14) << row.key;
    EXPECT_NEAR(n.viewpoint().fov_y_deg, 40, 1e-12);
    EXPECT_NEAR(n.viewpoint().focus_distance, 3, 1e-12);
  }
  Navigator n(arbitrary_viewpoint());
  n.key("bracketright");
  EXPECT_GT(n.viewpoint().focus_distance, 3);
  n.key("plus");
  EXPECT_LT(n.viewpoint().fov_y_deg, 40);
  n.key("r");
  EXPECT_EQ(n.viewpoint(), n.home());
  EXPECT_FALSE(n.key("F1"));
  EXPECT_FALSE(n.key(""));
  EXPECT_EQ(n.viewpoint(), n.home());
}

TEST(Navigator, ManyStepsKeepTheQuaternionAndThePivot) {
  Navigator n(arbitrary_viewpoint());
  const Vec3 pivot = n.pivot();
  std::mt19937 random(7);
  std::uniform_real_distribution<double> step(-0.05, 0.05);
  for (int i = 0; i < 100000; i++) {
    n.orbit(step(random), step(random));
    if (i % 2) n.fly({0, 0, 0});
  }
  EXPECT_NEAR(glm::length(n.viewpoint().pose.orientation), 1, 1e-15);
  EXPECT_LT(distance(n.pivot(), pivot), 1e-10);
  validate(make_view(n.viewpoint(), 640, 480));
}

// A viewpoint that moves sideways and turns looks beyond the cameras' coverage: it then moves on and turns less.
TEST(Navigator, ViewTurnsBackIfTurningHidesTheScene) {
  Navigator n;
  // Each degree of rotation darkens another 2 % of the view, independent of the position.
  n.set_visibility([](const Viewpoint& v) {
    return std::clamp(1 - 0.02 * std::acos(std::min(1.0, v.pose.forward().z)) * (180 / M_PI), 0.0, 1.0);
  });
  for (int i = 0; i < 20; i++) n.orbit(-0.05, 0);
  EXPECT_GT(n.viewpoint().pose.position.x, 0.4);
  EXPECT_NEAR(std::acos(n.viewpoint().pose.forward().z) * (180 / M_PI), 2.5, 0.1) << "5 % of the home view";
}

// Full visibility for |x| and |y| up to 0.1 m, 95 % at 0.11 m, and none from 0.3 m.
double seen_from(const Viewpoint& v) {
  const double off = std::max(std::abs(v.pose.position.x), std::abs(v.pose.position.y));
  return std::clamp(1.5 - 5 * off, 0.0, 1.0);
}

TEST(Navigator, NoMovementLosesSightOfTheArray) {
  Navigator n;
  n.set_visibility(seen_from);
  const auto position = [&] { return n.viewpoint().pose.position; };
  n.orbit(-1, 0);
  EXPECT_NEAR(position().x, 0.11, 0.005);
  EXPECT_GE(seen_from(n.viewpoint()), Navigator::kMinVisible);
  for (int i = 0; i < 20; i++) n.orbit(-0.05, 0.01);
  EXPECT_LT(position().y, -0.02);
  EXPECT_NEAR(position().x, 0.11, 0.005);
  n.orbit(0.1, 0);
  EXPECT_LT(position().x, 0.08);
  n.reset();
  n.pan(-0.3, -0.2);
  EXPECT_GT(n.pivot().x, 0.45);
  EXPECT_NEAR(position().x, 0.11, 0.005);
  EXPECT_NEAR(n.viewpoint().pose.right().y, 0, 1e-12);
  EXPECT_GE(seen_from(n.viewpoint()), Navigator::kMinVisible);
  n.reset();
  for (int i = 0; i < 100; i++) n.orbit(0.05, 0.05);
  EXPECT_GE(seen_from(n.viewpoint()), Navigator::kMinVisible);
  EXPECT_LT(glm::length(n.pivot() - Vec3(0, 0, 2)), 1e-9);
}

TEST(Navigator, UncorrectableMovementsStop) {
  Navigator n;
  // A view twice as wide as the home view is half covered at any position.
  n.set_visibility([&n](const Viewpoint& v) { return std::min(1.0, n.home().fov_y_deg / v.fov_y_deg); });
  for (int i = 0; i < 100; i++) n.zoom(-1);
  EXPECT_NEAR(n.viewpoint().fov_y_deg, n.home().fov_y_deg / Navigator::kMinVisible, 0.1);
  EXPECT_EQ(n.viewpoint().pose, n.home().pose);
  n.zoom(1);
  EXPECT_LT(n.viewpoint().fov_y_deg, 1.01 * n.home().fov_y_deg);
}

TEST(Navigator, MovementsReturnFromDarkViews) {
  Navigator n;
  for (int i = 0; i < 50; i++) n.key("d");
  EXPECT_NEAR(n.viewpoint().pose.position.x, 1, 1e-12);
  n.set_visibility(seen_from);
  // Every movement is allowed at uncovered positions; with some coverage, movements never reduce the coverage or jump.
  n.key("d");
  EXPECT_GT(n.viewpoint().pose.position.x, 1.01);
  Viewpoint v;
  v.pose.position.x = 0.25;
  n.set(v);
  n.key("d");
  EXPECT_NEAR(n.viewpoint().pose.position.x, 0.25, 0.001);
  n.key("a");
  EXPECT_LT(n.viewpoint().pose.position.x, 0.24);
}

TEST(Navigator, SetKeepsLimits) {
  Navigator n;
  Viewpoint v = arbitrary_viewpoint();
  v.pose.position.x = 1e300;
  v.pose.orientation = Quat(0, 0, 2, 0);
  v.fov_y_deg = 500;
  v.focus_distance = -1;
  n.set(v);
  EXPECT_EQ(n.viewpoint().pose.position.x, kMaxPosition);
  EXPECT_EQ(n.viewpoint().pose.orientation, Quat(0, 0, 1, 0));
  EXPECT_EQ(n.viewpoint().fov_y_deg, kMaxFovDeg);
  EXPECT_EQ(n.viewpoint().focus_distance, kMinFocus);
}

TEST(DefaultViewpoint, IsInTheMiddleOfTheArray) {
  const Pose world_from_array = arbitrary_viewpoint().pose;
  Rig rig = array(5, 7, 0.1, world_from_array);
  const Viewpoint v = default_viewpoint(rig);
  EXPECT_LT(distance(v.pose.position, world_from_array.position), 1e-14);
  EXPECT_GT(std::abs(glm::dot(v.pose.orientation, world_from_array.orientation)), 1 - 1e-14);
  EXPECT_NEAR(make_view(v, 320, 240).lens.fx(), 400, 1e-9);
  EXPECT_NEAR(v.focus_distance, kFocusPerExtent * std::hypot(0.6, 0.4), 1e-12);
  rig.focus_distance = 5;
  EXPECT_EQ(default_viewpoint(rig).focus_distance, 5);
  EXPECT_EQ(default_viewpoint(rig, 7.5).focus_distance, 7.5);
  EXPECT_EQ(middle_camera(rig), 17u);
}

TEST(DefaultViewpoint, MeanOfDifferingOrientations) {
  Rig rig = array(1, 2, 0.2, {});
  rig.cameras[0].pose.orientation = quat_from_euler({20, 5, 0});
  rig.cameras[1].pose.orientation = -quat_from_euler({-20, 5, 0});
  const EulerAngles e = euler_from_quat(default_viewpoint(rig).pose.orientation);
  EXPECT_NEAR(e.yaw, 0, 1e-12);
  EXPECT_NEAR(e.roll, 0, 1e-12);
  EXPECT_NEAR(e.pitch, 5, 0.5);
}

TEST(DefaultViewpoint, OneCameraAndCancellingAxes) {
  Rig one = array(1, 1, 0.1, arbitrary_viewpoint().pose);
  const Viewpoint v = default_viewpoint(one);
  EXPECT_EQ(v.pose.position, one.cameras[0].pose.position);
  EXPECT_EQ(v.focus_distance, 1);

  Rig ring = array(1, 4, 0, {});
  for (int i = 0; i < 4; i++) {
    ring.cameras[i].pose.orientation = quat_from_euler({90.0 * i, 0, 0});
    ring.cameras[i].pose.position = -ring.cameras[i].pose.forward();
  }
  const Viewpoint inside = default_viewpoint(ring);
  EXPECT_TRUE(is_finite(inside));
  EXPECT_EQ(inside.pose.orientation, ring.cameras[middle_camera(ring)].pose.orientation);
  validate(make_view(inside, 320, 240));
}

TEST(ViewpointBehind, SeesAllCameras) {
  Rig rig = make_grid_rig({.rows = 3, .columns = 7, .pitch = 0.1, .fov_y_deg = 40, .width = 320, .height = 240});
  for (Camera& camera : rig.cameras) camera.pose.position += Vec3(5, -2, 0.05 * camera.pose.position.x);
  for (const double aspect : {0.5, 4.0 / 3, 3.0}) {
    const Viewpoint front = default_viewpoint(rig, 2), behind = viewpoint_behind(rig, aspect, 2);
    const View view = make_view(behind, static_cast<int>(400 * aspect), 400);
    double farthest = 0;
    for (const Camera& camera : rig.cameras) {
      const Vec3 at = view.pose.camera_from_world(camera.pose.position);
      ASSERT_GT(at.z, 0);
      const Vec2 pixel = *view.lens.project(at);
      farthest = std::max({farthest, std::abs(pixel.x / (view.width - 1) - 0.5), std::abs(pixel.y / 399 - 0.5)});
    }
    EXPECT_NEAR(farthest, 0.4, 0.01) << "margin of a tenth of the view";
    EXPECT_NEAR(glm::length(pivot_point(front) - pivot_point(behind)), 0, 1e-9) << "the point in focus stays";
  }
}

}  // namespace
}  // namespace lf
