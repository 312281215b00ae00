// SPDX-License-Identifier: LGPL-2.1-or-later
#include "render/ownership.h"
#include "geometry/pose.h"
#include "lib/render/production.h"
#include "reference/generators.h"
#include "reference/renderer.h"
#include "rig/rig.h"
#include "support/test.h"
#include "view/navigator.h"

namespace lf {
namespace {

using reference::Random;

constexpr int32_t kNone = -1;

// The rule for the owner of a pixel, from the same inputs.
int32_t owner_of(const ViewPlan& plan, int x, int y) {
  const Vec2 ray = plan.rays().at(x, y);
  const double along = glm::dot(plan.focal_normal(), Vec3(ray, 1));
  if (!(plan.focal_offset() > 0 ? along > 0 : along < 0)) return kNone;
  for (size_t i = 0; i < plan.faces().size(); i++) {
    const FacePlan& face = plan.faces()[i];
    double e[3];
    for (int k = 0; k < 3; k++) e[k] = FacePlan::evaluate(face.edge[k], ray);
    const double sum = e[0] + e[1] + e[2];
    const bool inside =
        (e[0] >= 0 && e[1] >= 0 && e[2] >= 0 && sum > 0) || (e[0] <= 0 && e[1] <= 0 && e[2] <= 0 && sum < 0);
    if (inside && glm::dot(face.facing, Vec3(ray, 1)) > 0) return static_cast<int32_t>(i);
  }
  return kNone;
}

int64_t count_owned(const Rig& rig, const View& view) {
  const Mesh mesh = build_mesh(rig);
  const ViewPlan plan(rig, mesh, view);
  const FaceRuns runs(plan, test::whole(view));
  int64_t owned = 0;
  for (int y = 0; y < view.height; y++) {
    std::vector<int32_t> owner(view.width, kNone);
    int end = 0;
    for (const FaceRun& run : runs.row(y)) {
      EXPECT_GE(run.x0, end);
      EXPECT_LT(run.x0, run.x1);
      EXPECT_LE(run.x1, view.width);
      end = run.x1;
      std::fill(owner.begin() + run.x0, owner.begin() + run.x1, run.face);
      owned += run.x1 - run.x0;
    }
    for (int x = 0; x < view.width; x++) EXPECT_EQ(owner[x], owner_of(plan, x, y)) << "pixel " << x << ", " << y;
  }
  return owned;
}

TEST(FaceRuns, MatchEveryPixel) {
  for (const reference::HardCase& small : reference::hard_cases())
    for (const reference::HardCase& hard : {small, reference::enlarged(small, reference::kEnlarged)}) {
      SCOPED_TRACE(hard.name);
      for (int trial = 0; trial < 2; trial++) {
        Random random(trial);
        const auto [rig, view] = hard.make(random);
        count_owned(rig, view);
      }
    }
}

// Vertical, horizontal and slanted face edges through pixel centres: the last bit decides the owner.
TEST(FaceRuns, AreExactAtEdgesThroughPixels) {
  const Rig rig = make_grid_rig({5, 5, 0.25, 60, 64, 48});
  View view;
  view.width = view.height = 65;
  view.lens = Lens::pinhole(32, 32, 32);
  view.blending.fills_gaps = false;  // cells with gaps have another owner
  for (const double distance : {-0.5, -1.0, 0.5, 1.0}) {
    SCOPED_TRACE(distance);
    view.pose.position = {0, 0, distance};
    view.focus.plane = plane_through({0, 0, 4}, {0, 0, -1});
    EXPECT_GT(count_owned(rig, view), 500);
  }
}

// Surrounding arrays: a line of sight intersects them twice, but no pixel may count twice.

constexpr int kWidth = 40, kHeight = 30;

struct Counted {
  int owned = 0, pixels = 0;
};

Counted count(const Rig& rig, const Viewpoint& viewpoint) {
  const Mesh mesh = build_mesh(rig);
  View view = make_view(viewpoint, kWidth, kHeight);
  view.blending.extrapolates = false;
  const test::Production production(rig, mesh, view);
  const auto own_weights = production.own_weights();
  const reference::Picture expected = reference::render(rig, mesh, view, {});
  Counted counted;
  for (int y = 0; y < kHeight; y++)
    for (int x = 0; x < kWidth; x++) {
      double sum = 0;
      for (const auto& own : own_weights) {
        const double weight = own.weight[static_cast<size_t>(y) * kWidth + x];
        if (expected.at(x, y).owner_margin > 1e-9) {
          EXPECT_NEAR(weight, expected.weight_of(x, y, own.camera), 1e-6) << x << ", " << y;
        }
        sum += weight;
      }
      counted.pixels++;
      counted.owned += sum > 0.5;
      EXPECT_NEAR(sum, sum > 0.5 ? 1 : 0, 1e-6) << x << ", " << y;
    }
  return counted;
}

Viewpoint at(const Vec3& eye, double yaw, double pitch, double focus) {
  Viewpoint v;
  v.pose = {eye, quat_from_euler({yaw, pitch, 0})};
  v.fov_y_deg = 40;
  v.focus_distance = focus;
  return v;
}

TEST(RingArrays, NoPixelIsCountedTwiceAroundACylinder) {
  std::mt19937 random(11);
  std::uniform_real_distribution<double> place(-2.2, 2.2), height(-0.15, 0.15), yaw(-180, 180), pitch(-10, 10);
  for (const bool inward : {true, false}) {
    const Rig rig =
        make_cylinder_rig({.rows = 3, .columns = 12, .pitch = 0.4, .radius = 1.5, .inward = inward, .fov_y_deg = 60});
    const Vec3 middle(0, 0, inward ? 1.5 : 0);
    int owned = 0;
    for (int i = 0; i < 60; i++) {
      const Vec3 eye = middle + Vec3(place(random), height(random), place(random));
      owned += count(rig, at(eye, yaw(random), pitch(random), 2)).owned;
    }
    EXPECT_GT(owned, 60 * kWidth * kHeight / 4);
    // Cameras that face away from the viewing direction do not contribute.
    const Counted all = count(rig, at(middle, 77, 0, 3));
    EXPECT_GT(all.owned, all.pixels / 4);
  }
}

TEST(RingArrays, EveryDirectionIsSeenOnceFromACylindersAxis) {
  for (const bool inward : {true, false}) {
    const Rig rig =
        make_cylinder_rig({.rows = 2, .columns = 12, .pitch = 2, .radius = 1, .inward = inward, .fov_y_deg = 90});
    for (int yaw = 0; yaw < 360; yaw += 45) {
      const Counted all = count(rig, at({0, 0, inward ? 1 : 0}, yaw, 0, 3));
      EXPECT_EQ(all.owned, all.pixels) << "no gap where the ring closes, " << yaw;
    }
  }
}

TEST(RingArrays, NoPixelIsCountedTwiceOnACircle) {
  const Rig rig = make_ring_rig({.cameras = 9, .radius = 0.4, .fov_y_deg = 60});
  int owned = 0;
  for (const double z : {-0.7, 0.0, 0.3})
    for (const double x : {0.0, 0.1, -0.3}) owned += count(rig, at({x, 0.05, z}, 0, 0, 2)).owned;
  EXPECT_GT(owned, 4 * kWidth * kHeight);
}

}  // namespace
}  // namespace lf
