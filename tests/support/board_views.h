// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <random>

#include "calibration/zhang.h"
#include "geometry/pose.h"

namespace lf {

inline constexpr Checkerboard kTestBoard = {8, 6, 0.03};

// World = camera; the board's pose in it: about 0.4 m away, tilted by up to `tilt` radians.
inline Pose board_pose(std::mt19937& random, double tilt) {
  std::uniform_real_distribution<double> uniform(-1, 1);
  const double a = tilt * uniform(random), b = tilt * uniform(random), c = uniform(random);
  const Quat turn =
      glm::angleAxis(a, Vec3(1, 0, 0)) * glm::angleAxis(b, Vec3(0, 1, 0)) * glm::angleAxis(c, Vec3(0, 0, 1));
  const Vec3 middle(0.105, 0.075, 0);
  const Vec3 place(0.07 * uniform(random), 0.05 * uniform(random), 0.42 + 0.08 * uniform(random));
  return {place - glm::mat3_cast(turn) * middle, turn};
}

// What `lens` sees of the board in `count` poses, with Gaussian noise in x and in y.
inline std::vector<BoardView> board_views(const Lens& lens, size_t count, double noise, uint32_t seed,
                                          double tilt = 0.6) {
  std::mt19937 random(seed);
  std::normal_distribution<double> normal(0, noise);
  std::vector<BoardView> views;
  while (views.size() < count) {
    const Pose pose = board_pose(random, tilt);
    BoardView view{"view " + std::to_string(views.size()), {}};
    for (size_t i = 0; i < kTestBoard.num_corners(); i++) {
      const auto pixel = lens.project(pose.world_from_camera(Vec3(kTestBoard.corner(i), 0)));
      if (pixel) view.corners.push_back(*pixel + Vec2(normal(random), normal(random)));
    }
    if (view.corners.size() == kTestBoard.num_corners()) views.push_back(view);
  }
  return views;
}

}  // namespace lf
