// SPDX-License-Identifier: LGPL-2.1-or-later
#include "geometry/pose.h"

#include <algorithm>
#include <cmath>
#include <string>

#include "base/text.h"

namespace lf {
namespace {

constexpr double kPole = 1e-12;  // sqrt(2) sin of half the angle to straight up or down

// The two of `count` nodes around a pixel, and the interpolation weight of the second.
struct Between {
  Between(double pixel, int step, int count) {
    const double at = std::clamp((pixel + 0.5) / step - 0.5, 0.0, count - 1.0);
    first = std::min(static_cast<int>(at), std::max(count - 2, 0));
    second = std::min(first + 1, count - 1);
    part = at - first;
  }
  int first, second;
  double part;
};

bool is_plane(const Plane& plane) {
  return std::abs(glm::length(plane.normal) - 1) <= kUnitTolerance && std::isfinite(plane.d);
}

}  // namespace

Pose look_at(const Vec3& eye, const Vec3& target, const Vec3& down) {
  const Vec3 z = glm::normalize(target - eye);
  const Vec3 x = glm::normalize(glm::cross(down, z));
  const Vec3 y = glm::cross(z, x);
  return {eye, glm::normalize(glm::quat_cast(Mat3(x, y, z)))};
}

Quat quat_from_euler(const EulerAngles& degrees) {
  const auto turn = [](double angle_deg, const Vec3& axis) { return glm::angleAxis(angle_deg * (M_PI / 180), axis); };
  return glm::normalize(turn(degrees.yaw, {0, 1, 0}) * turn(degrees.pitch, {1, 0, 0}) * turn(degrees.roll, {0, 0, 1}));
}

// With half angles y, p, r of yaw, pitch, roll, the product of the three rotations is
//   w + qx = (cos p + sin p) cos(y - r),  qy - qz = (cos p + sin p) sin(y - r),
//   w - qx = (cos p - sin p) cos(y + r),  qy + qz = (cos p - sin p) sin(y + r).
// Near a pole, only the angle that no longer matters loses precision.
EulerAngles euler_from_quat(const Quat& orientation) {
  const Quat q = glm::normalize(orientation);
  const double up = std::hypot(q.w + q.x, q.y - q.z), down = std::hypot(q.w - q.x, q.y + q.z);
  const double difference = std::atan2(q.y - q.z, q.w + q.x), sum = std::atan2(q.y + q.z, q.w - q.x);
  double yaw = sum + difference, roll = sum - difference;
  if (down < kPole || up < kPole) {
    yaw = 2 * (down < kPole ? difference : sum);
    roll = 0;
  }
  const double pitch = 2 * std::atan2(up, down) - M_PI / 2;
  return {std::remainder(yaw, 2 * M_PI) * (180 / M_PI), pitch * (180 / M_PI),
          std::remainder(roll, 2 * M_PI) * (180 / M_PI)};
}

FocalMap FocalMap::for_view(int width, int height, int step) {
  FocalMap map;
  map.step = step;
  const auto count = [&] {
    map.columns = nodes(width, map.step);
    map.rows = nodes(height, map.step);
    return static_cast<size_t>(map.columns) * static_cast<size_t>(map.rows);
  };
  while (count() > kMaxNodes) map.step *= 2;
  return map;
}

FocalMap FocalMap::refined(int width, int height) const {
  FocalMap fine = for_view(width, height);
  if (fine.step >= step || step % fine.step != 0) return *this;
  fine.from = from;
  fine.farthest = farthest;
  fine.nearest = nearest;
  fine.measured = measured;
  fine.levels.resize(static_cast<size_t>(fine.columns) * static_cast<size_t>(fine.rows));
  // Interpolates in integer arithmetic. A fine node is (2 i + 1 - ratio) / (2 ratio) coarse nodes from the first coarse
  // node.
  const int ratio = step / fine.step, whole = 2 * ratio;
  struct Place {
    int first, second, part;  // part: in 1 / `whole`
  };
  const auto place = [&](int i, int count) {
    const int at = std::clamp(2 * i + 1 - ratio, 0, whole * (count - 1));
    const int first = std::min(at / whole, std::max(count - 2, 0));
    return Place{first, std::min(first + 1, count - 1), at - whole * first};
  };
  std::vector<Place> across;
  for (int i = 0; i < fine.columns; i++) across.push_back(place(i, columns));
  std::vector<int> between(static_cast<size_t>(columns));
  for (int j = 0; j < fine.rows; j++) {
    const Place down = place(j, rows);
    const uint8_t* const upper = &levels[static_cast<size_t>(down.first) * columns];
    const uint8_t* const lower = &levels[static_cast<size_t>(down.second) * columns];
    for (int i = 0; i < columns; i++)
      between[static_cast<size_t>(i)] = whole * upper[i] + down.part * (lower[i] - upper[i]);
    uint8_t* const out = &fine.levels[static_cast<size_t>(j) * fine.columns];
    for (int i = 0; i < fine.columns; i++) {
      const Place& at = across[static_cast<size_t>(i)];
      const int first = between[static_cast<size_t>(at.first)], second = between[static_cast<size_t>(at.second)];
      out[i] = static_cast<uint8_t>((whole * first + at.part * (second - first) + whole * whole / 2) / (whole * whole));
    }
  }
  return fine;
}

uint8_t FocalMap::level_of(double inverse) const {
  const double level = (inverse - farthest) / (nearest - farthest) * kLevels;
  return static_cast<uint8_t>(std::lround(std::clamp(level, 0.0, kLevels)));
}

double FocalMap::inverse_at(double x, double y) const {
  const Between across(x, step, columns), down(y, step, rows);
  const auto row = [&](int j) {
    const uint8_t* levels_of = levels.data() + static_cast<size_t>(j) * columns;
    return levels_of[across.first] + across.part * (levels_of[across.second] - levels_of[across.first]);
  };
  const double upper = row(down.first);
  return inverse_of(upper + down.part * (row(down.second) - upper));
}

void FocalMap::inverse_row(double x, double spacing, double y, int count, float* out) const {
  const Between down(y, step, rows);
  const uint8_t* const upper = levels.data() + static_cast<size_t>(down.first) * columns;
  const uint8_t* const lower = levels.data() + static_cast<size_t>(down.second) * columns;
  const auto part = static_cast<float>(down.part), scale = static_cast<float>((nearest - farthest) / kLevels);
  const auto far_end = static_cast<float>(farthest);
  const auto inverse = [&](int i) {
    return far_end + scale * (upper[i] + part * static_cast<float>(lower[i] - upper[i]));
  };
  // The first position, and the distance between positions, in nodes.
  const double first = (x + 0.5) / step - 0.5, along = spacing / step;
  const auto past = [&](int node) {
    return static_cast<int>(std::clamp(std::ceil((node - first) / along), 0.0, static_cast<double>(count)));
  };
  int i = past(0);
  std::fill(out, out + i, inverse(0));
  for (int node = std::max(static_cast<int>(first), 0); node + 1 < columns && i < count; node++) {
    const float at = inverse(node), rise = inverse(node + 1) - at;
    const auto begin = static_cast<float>(first - node), slope = static_cast<float>(along);
    for (const int end = past(node + 1); i < end; i++) out[i] = at + (begin + static_cast<float>(i) * slope) * rise;
  }
  std::fill(out + i, out + count, inverse(columns - 1));
}

FocalMap::LevelRange FocalMap::range_of(std::span<const uint8_t> of, double x0, double y0, double x1, double y1) const {
  const int left = Between(x0, step, columns).first, right = Between(x1, step, columns).second;
  const int top = Between(y0, step, rows).first, bottom = Between(y1, step, rows).second;
  uint8_t least = 255, largest = 0;
  for (int j = top; j <= bottom; j++) {
    const uint8_t* const row = of.data() + static_cast<size_t>(j) * columns;
    for (int i = left; i <= right; i++) {
      least = std::min(least, row[i]);
      largest = std::max(largest, row[i]);
    }
  }
  return {least, largest};
}

void validate(const FocalSurface& surface, int width, int height) {
  if (!is_plane(surface.plane)) throw Error("focal_plane: must be finite numbers with a normal of unit length");
  if (!surface.map) return;
  const FocalMap& map = *surface.map;
  if (!is_plane(map.from)) throw Error("focal_map: its plane must be finite numbers with a normal of unit length");
  if (map.step < 1 || map.step > FocalMap::kMaxStep)
    throw Error("focal_map: its step must be 1 to " + std::to_string(FocalMap::kMaxStep) + " pixels, is " +
                std::to_string(map.step));
  if (map.columns != FocalMap::nodes(width, map.step) || map.rows != FocalMap::nodes(height, map.step))
    throw Error("focal_map: " + std::to_string(map.columns) + " x " + std::to_string(map.rows) +
                " nodes do not match the size of the view");
  if (map.levels.size() > FocalMap::kMaxNodes)
    throw Error("focal_map: at most " + std::to_string(FocalMap::kMaxNodes) + " nodes, not " +
                std::to_string(map.levels.size()));
  if (map.levels.size() != static_cast<size_t>(map.columns) * static_cast<size_t>(map.rows))
    throw Error("focal_map: " + std::to_string(map.levels.size()) + " levels do not match its size");
  if (!(map.farthest >= 0) || !(map.nearest > map.farthest) || !std::isfinite(map.nearest))
    throw Error("focal_map: inverse distances must be 0 <= farthest < nearest");
}

}  // namespace lf
