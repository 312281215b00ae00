// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "base/maths.h"

namespace lf {

// a x + b y + c z + d = 0 in world coordinates; normal = (a, b, c) has unit length, d in metres.
struct Plane {
  Vec3 normal{0, 0, 1};
  double d = 0;

  double signed_distance(const Vec3& x_world) const { return glm::dot(normal, x_world) + d; }
  bool operator==(const Plane&) const = default;
};

inline Plane plane_through(const Vec3& point, const Vec3& unit_normal) {
  return {unit_normal, -glm::dot(unit_normal, point)};
}

// world_from_camera. Axes of world and camera alike: right-handed, x right, y down, z forward (OpenCV, COLMAP).
struct Pose {
  Vec3 position{0, 0, 0};        // centre of projection in the world, metres
  Quat orientation{1, 0, 0, 0};  // w, x, y, z; unit norm

  // world_from_camera; a rotation however far within kUnitTolerance |orientation| is from 1.
  Mat3 rotation() const { return glm::mat3_cast(glm::normalize(orientation)); }
  Vec3 forward() const { return rotation()[2]; }  // optical axis in the world, unit length
  Vec3 right() const { return rotation()[0]; }
  Vec3 down() const { return rotation()[1]; }

  Vec3 world_from_camera(const Vec3& x_camera) const { return rotation() * x_camera + position; }
  Vec3 camera_from_world(const Vec3& x_world) const { return glm::transpose(rotation()) * (x_world - position); }

  bool operator==(const Pose&) const = default;
};

// Pose at `eye` looking at `target`, with the camera's y axis as near to `down` as it can be.
// Requires eye != target and the line of sight not parallel to `down`.
Pose look_at(const Vec3& eye, const Vec3& target, const Vec3& down);

// An orientation as people type it, in degrees; right-handed turns about the camera's own axes, applied yaw first:
// R = Ry(yaw) Rx(pitch) Rz(roll). With x right, y down, z forward: yaw > 0 turns right, pitch > 0 looks up, roll > 0
// turns the camera clockwise (as seen from behind it). All zero: axes along the world's.
struct Euler {
  double yaw = 0, pitch = 0, roll = 0;
};

Quat quat_from_euler(const Euler& degrees);  // unit norm
// yaw and roll in [-180, 180], pitch in [-90, 90]; straight up or down roll is 0 and yaw carries both.
// quat_from_euler() of the result is the same orientation to 1e-14 everywhere.
Euler euler_from_quat(const Quat& orientation);

// A map of inverse distances over a view: one node for every step x step pixels, in between bilinear, beyond the outer
// nodes as at them. Node (i, j) stands in the middle of its pixels, at ((i + 1/2) step - 1/2, (j + 1/2) step - 1/2).
struct FocalMap {
  static constexpr int kMaxStep = 64;  // pixels
  static constexpr size_t kMaxNodes = size_t{1} << 20;
  static constexpr int kFinestStep = 4;
  Plane from;              // the plane that distances are counted from, along its normal
  int step = kFinestStep;  // pixels of the view
  int columns = 0, rows = 0;
  double farthest = 0, nearest = 0;  // inverse distances of levels 0 and 255, 1/m
  std::vector<uint8_t> levels;       // row-major

  static constexpr double kLevels = 255;

  static int nodes(int pixels, int step) { return (pixels + step - 1) / step; }
  // The nodes of a view, `step` pixels apart (kFinestStep times a power of two) or as many more as kMaxNodes asks for;
  // no levels yet.
  static FocalMap for_view(int width, int height, int step = kFinestStep);
  double inverse_of(double level) const { return farthest + (nearest - farthest) * (level / kLevels); }
  // The level nearest to an inverse distance, clamped to 0..255.
  uint8_t level_of(double inverse) const;
  // The map that a view of this size is drawn through: this one with nodes kFinestStep pixels apart, in between
  // bilinear, rounded to levels, the same on every machine. As it is where its step is no multiple of that or as fine.
  FocalMap refined(int width, int height) const;
  // Inverse distance at a position in the view, pixels.
  double inverse_at(double x, double y) const;
  // Inverse distances at `count` positions of a row, `spacing` pixels apart from x on.
  void inverse_row(double x, double spacing, double y, int count, float* out) const;
  // The least and the largest level that positions in [x0, x1] x [y0, y1] depend on: of what lies between nodes, the
  // nodes'. `levels`: this map's, or others of its size.
  struct LevelRange {
    uint8_t least, largest;
  };
  LevelRange range_of(std::span<const uint8_t> levels, double x0, double y0, double x1, double y1) const;
  bool operator==(const FocalMap&) const = default;
};

// The surface on which a line of sight takes its colour: X is where the two meet. A plane, or a map: then X is at the
// distance that the map has for the pixel.
struct FocalSurface {
  Plane plane;                          // the viewer's; with a map, for those who can't do better
  std::shared_ptr<const FocalMap> map;  // may be null

  bool operator==(const FocalSurface& o) const {
    return plane == o.plane && (map == o.map || (map && o.map && *map == *o.map));
  }
};

// Throws Error ("focal_plane: ...", "focal_map: ...") for numbers that are not finite, a normal not of unit length, or
// a map that is not one of a view of width x height pixels.
void validate(const FocalSurface& surface, int width, int height);

}  // namespace lf
