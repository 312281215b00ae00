// SPDX-License-Identifier: LGPL-2.1-or-later
#include "scene/objects.h"

#include <algorithm>
#include <cmath>

#include <gtest/gtest.h>
#include <glm/geometric.hpp>

#include "scene/scene.h"

namespace lf::scene {

namespace {

TEST(Objects, EverythingStandsInTheRoom) {
  const auto inside = [](const V3& p, float r) {
    constexpr float kSlack = 0.001f;
    for (int axis = 0; axis < 3; axis++)
      if (p[axis] - r < kRoomMin[axis] - kSlack || p[axis] + r > kRoomMax[axis] + kSlack) return false;
    return true;
  };
  for (double time = 0; time < kScenePeriod; time += 0.21) {
    const Objects o = objects_at(time);
    for (const Sphere& s : o.spheres) EXPECT_TRUE(inside(s.centre, s.radius)) << "sphere at " << time;
    for (const Block& b : o.blocks) EXPECT_TRUE(inside(b.centre, b.half.y)) << "block at " << time;
    for (const Pillar& p : o.pillars) {
      EXPECT_LT(p.top, p.bottom);
      EXPECT_TRUE(inside({p.x, p.bottom, p.z}, 0));
    }
  }
}

TEST(Objects, GroupsHoldEachSphereAndCapsuleOnce) {
  const Objects o = objects_at(1.3);
  std::vector<int> spheres(o.spheres.size()), capsules(o.capsules.size());
  for (const Group& g : o.groups) {
    const auto expect_held = [&](const V3& p, float r) { EXPECT_LE(glm::length(p - g.centre) + r, g.radius); };
    for (uint32_t i = g.first_sphere; i < g.last_sphere; i++) {
      spheres[i]++;
      expect_held(o.spheres[i].centre, o.spheres[i].radius);
    }
    for (uint32_t i = g.first_capsule; i < g.last_capsule; i++) {
      capsules[i]++;
      expect_held(o.capsules[i].base, o.capsules[i].radius);
      expect_held(o.capsules[i].base + o.capsules[i].axis, o.capsules[i].radius);
    }
  }
  EXPECT_EQ(spheres, std::vector<int>(spheres.size(), 1));
  EXPECT_EQ(capsules, std::vector<int>(capsules.size(), 1));
}

TEST(Objects, MoveWithThePeriodOfTheScene) {
  const Objects now = objects_at(0.7), later = objects_at(0.7 + kScenePeriod), between = objects_at(0.7 + 1.1);
  float moved = 0;
  for (size_t i = 0; i < now.spheres.size(); i++) {
    EXPECT_LT(glm::length(now.spheres[i].centre - later.spheres[i].centre), 1e-5f);
    moved = std::max(moved, glm::length(now.spheres[i].centre - between.spheres[i].centre));
  }
  EXPECT_GT(moved, 0.3f);
}

TEST(Objects, NothingMovesFasterThanAWalker) {
  constexpr double kStep = 0.005;
  float fastest = 0;
  for (double time = 0; time < kScenePeriod; time += 0.05) {
    const Objects a = objects_at(time), b = objects_at(time + kStep);
    for (size_t i = 0; i < a.spheres.size(); i++)
      fastest = std::max(fastest, glm::length(a.spheres[i].centre - b.spheres[i].centre) / static_cast<float>(kStep));
  }
  EXPECT_GT(fastest, 0.3f);
  EXPECT_LT(fastest, 1.2f);
}

Objects figure_at(double time) {
  Objects o;
  add_figure(time, o);
  return o;
}

float lowest(const Objects& o) {
  float y = -1e9f;
  for (const Sphere& s : o.spheres) y = std::max(y, s.centre.y + s.radius);
  for (const Capsule& c : o.capsules) y = std::max({y, c.base.y + c.radius, c.base.y + c.axis.y + c.radius});
  return y;
}

TEST(Figure, WalksOnTheFloor) {
  for (double time = 0; time < kScenePeriod; time += 0.03) EXPECT_NEAR(lowest(figure_at(time)), kFloor, 0.012) << time;
}

TEST(Figure, LimbsKeepTheirLengths) {
  // Bones are rigid: no capsule but the balloon's string, the last, may stretch.
  const Objects first = figure_at(0);
  for (double time = 0.1; time < kScenePeriod; time += 0.17) {
    const Objects o = figure_at(time);
    ASSERT_EQ(o.capsules.size(), first.capsules.size());
    for (size_t i = 0; i + 1 < o.capsules.size(); i++)
      EXPECT_NEAR(glm::length(o.capsules[i].axis), glm::length(first.capsules[i].axis), 0.012) << i << " at " << time;
  }
}

TEST(Figure, StaysAroundTheMiddleDepth) {
  float near = 1e9f, far = 0;
  for (double time = 0; time < kScenePeriod; time += 0.1)
    for (const Group& g : figure_at(time).groups) {
      near = std::min(near, g.centre.z);
      far = std::max(far, g.centre.z);
    }
  EXPECT_GT(near, kSceneMiddle - 0.3);
  EXPECT_LT(far, kSceneMiddle + 0.4);
  EXPECT_GT(far - near, 0.15f);
}

}  // namespace

}  // namespace lf::scene
