// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cmath>
#include <random>

#include "calibration/intrinsics.h"
#include "geometry/pose.h"
#include "image/image.h"

namespace lf {

inline const CalibrationBoard kTestBoard = {8, 6, 0.03};

// Returns a random pose of the board in camera coordinates: about 0.4 m away, tilted by up to `tilt` radians.
inline Pose board_pose(std::mt19937& random, double tilt) {
  std::uniform_real_distribution<double> uniform(-1, 1);
  const double a = tilt * uniform(random), b = tilt * uniform(random), c = uniform(random);
  const Quat turn =
      glm::angleAxis(a, Vec3(1, 0, 0)) * glm::angleAxis(b, Vec3(0, 1, 0)) * glm::angleAxis(c, Vec3(0, 0, 1));
  const Vec3 middle(0.105, 0.075, 0);
  const Vec3 place(0.07 * uniform(random), 0.05 * uniform(random), 0.42 + 0.08 * uniform(random));
  return {place - glm::mat3_cast(turn) * middle, turn};
}

// Returns detections of the board in `count` poses, with Gaussian noise in x and y.
inline std::vector<BoardView> board_views(const Lens& lens, size_t count, double noise, uint32_t seed,
                                          double tilt = 0.6) {
  std::mt19937 random(seed);
  std::normal_distribution<double> normal(0, noise);
  std::vector<BoardView> views;
  while (views.size() < count) {
    const Pose pose = board_pose(random, tilt);
    BoardView view{"view " + std::to_string(views.size()), {}, {}};
    for (size_t i = 0; i < kTestBoard.num_corners(); i++) {
      const auto pixel = lens.project(pose.world_from_camera(Vec3(kTestBoard.corner(i), 0)));
      if (pixel) view.corners.push_back(*pixel + Vec2(normal(random), normal(random)));
    }
    if (view.corners.size() == kTestBoard.num_corners()) views.push_back(view);
  }
  return views;
}

// Checkerboard in units of squares from corner 0; white outside.
inline bool is_white_on_checkerboard(const Vec2& at) {
  const int column = static_cast<int>(std::floor(at.x)), row = static_cast<int>(std::floor(at.y));
  const bool outside = column < -1 || row < -1 || column >= kTestBoard.columns || row >= kTestBoard.rows;
  return outside || (column + row) % 2 != 0;
}

// Renders a board in a pose with 4x4 samples per pixel. is_white() takes a position on the board, in squares from
// corner 0.
template <class IsWhite>
Image picture_of_board(const Lens& lens, const Pose& pose, int width, int height, const IsWhite& is_white) {
  constexpr int kSamples = 4;
  Image image(PixelFamily::kRgb, width, height);
  for (int y = 0; y < height; y++)
    for (int x = 0; x < width; x++) {
      int white = 0;
      for (int s = 0; s < kSamples * kSamples; s++) {
        const Vec2 pixel(x + (s % kSamples + 0.5) / kSamples - 0.5, y + (s / kSamples + 0.5) / kSamples - 0.5);
        const Vec3 ray = pose.rotation()[2], direction(*lens.unproject(pixel), 1);
        const double t = glm::dot(ray, pose.position) / glm::dot(ray, direction);
        white += is_white(Vec2(pose.camera_from_world(direction * t)) / kTestBoard.square);
      }
      const auto value = static_cast<uint8_t>(30 + 200 * white / (kSamples * kSamples));
      for (int c = 0; c < 3; c++) image.pixel(x, y)[c] = value;
    }
  return image;
}

}  // namespace lf
