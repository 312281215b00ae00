// SPDX-License-Identifier: LGPL-2.1-or-later
#include "rig/camera_distances.h"

#include <cmath>
#include <functional>
#include <numbers>
#include <random>

#include <gtest/gtest.h>

namespace lf {
namespace {

Rig rig_of(int cameras, const std::function<Vec3(int)>& place) {
  Rig rig;
  for (int i = 0; i < cameras; i++) {
    rig.cameras.emplace_back();
    rig.cameras.back().pose.position = place(i);
  }
  return rig;
}

void expect_as_all_pairs(const Rig& rig) {
  double largest = 0, sum = 0;
  for (const Camera& a : rig.cameras) {
    double nearest = INFINITY;
    for (const Camera& b : rig.cameras) {
      if (&a == &b) continue;
      const double distance = glm::distance(a.pose.position, b.pose.position);
      largest = std::max(largest, distance);
      nearest = std::min(nearest, distance);
    }
    sum += nearest;
  }
  EXPECT_NEAR(largest_distance(rig), largest, 1e-9 * largest);
  EXPECT_NEAR(mean_nearest_distance(rig), sum / static_cast<double>(rig.cameras.size()), 1e-9 * largest);
}

TEST(CameraDistances, AreThoseOfAllPairs) {
  std::mt19937 random(1);
  std::uniform_real_distribution<double> number(-1, 1);
  for (int n : {2, 3, 10, 200}) {
    expect_as_all_pairs(rig_of(n, [&](int) { return Vec3(number(random), number(random), number(random)); }));
    expect_as_all_pairs(rig_of(n, [&](int) { return Vec3(5, number(random), 0); }));
    expect_as_all_pairs(rig_of(n, [&](int i) { return Vec3(i % 7, i / 7, 0); }));
    expect_as_all_pairs(rig_of(n, [&](int i) {
      const double angle = 2 * std::numbers::pi * i / n;
      return Vec3(std::cos(angle), 3, std::sin(angle));
    }));
    expect_as_all_pairs(rig_of(n, [&](int i) { return Vec3(i % 2, 0, 0); }));
  }
}

TEST(CameraDistances, OneCameraHasNone) {
  const Rig rig = rig_of(1, [](int) { return Vec3(1, 2, 3); });
  EXPECT_EQ(largest_distance(rig), 0);
  EXPECT_EQ(mean_nearest_distance(rig), 0);
}

}  // namespace
}  // namespace lf
