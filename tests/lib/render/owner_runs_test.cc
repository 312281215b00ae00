// SPDX-License-Identifier: LGPL-2.1-or-later
#include "render/owner_runs.h"

#include <gtest/gtest.h>

#include "lib/render/production.h"
#include "reference/hard_cases.h"
#include "rig/rig.h"

namespace lf {
namespace {

using reference::Random;

constexpr int32_t kNone = -1;

// The owner of a pixel as the rule says it, from the same numbers.
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
  const OwnerRuns runs(plan, test::whole(view));
  int64_t owned = 0;
  for (int y = 0; y < view.height; y++) {
    std::vector<int32_t> owner(view.width, kNone);
    int end = 0;
    for (const OwnerRun& run : runs.row(y)) {
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

TEST(OwnerRuns, AreWhatEveryPixelSays) {
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

// Edges of faces through pixel centres, upright, level and slanted: who owns those is decided by the last bit.
TEST(OwnerRuns, AreExactWhereEdgesMeetPixels) {
  const Rig rig = make_grid_rig({5, 5, 0.25, 60, 64, 48});
  View view;
  view.width = view.height = 65;
  view.lens = Lens::pinhole(32, 32, 32);
  for (const double distance : {-0.5, -1.0, 0.5, 1.0}) {
    SCOPED_TRACE(distance);
    view.pose.position = {0, 0, distance};
    view.focus.plane = plane_through({0, 0, 4}, {0, 0, -1});
    EXPECT_GT(count_owned(rig, view), 500);
  }
}

}  // namespace
}  // namespace lf
