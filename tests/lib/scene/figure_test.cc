// SPDX-License-Identifier: LGPL-2.1-or-later
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>

#include "scene/objects.h"
#include "scene/scene.h"

namespace lf::scene {
namespace {

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
