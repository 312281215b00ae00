// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "base/maths.h"

namespace lf {

// The plane a x + b y + c z + d = 0 in world coordinates. The normal (a, b, c) has unit length, and d is in metres.
struct Plane {
  Vec3 normal{0, 0, 1};
  double d = 0;

  double signed_distance(const Vec3& x_world) const { return glm::dot(normal, x_world) + d; }
  bool operator==(const Plane&) const = default;
};

inline Plane plane_through(const Vec3& point, const Vec3& unit_normal) {
  return {unit_normal, -glm::dot(unit_normal, point)};
}

// The pose of a camera, as the transformation world_from_camera. World and camera axes are right-handed with x to the
// right, y down and z forward, as in OpenCV and COLMAP.
struct Pose {
  Vec3 position{0, 0, 0};        // centre of projection in the world, metres
  Quat orientation{1, 0, 0, 0};  // w, x, y, z; unit norm

  // Returns the rotation of world_from_camera. The result is a rotation even if |orientation| is not exactly 1.
  Mat3 rotation() const { return glm::mat3_cast(glm::normalize(orientation)); }
  Vec3 forward() const { return rotation()[2]; }
  Vec3 right() const { return rotation()[0]; }
  Vec3 down() const { return rotation()[1]; }

  Vec3 world_from_camera(const Vec3& x_camera) const { return rotation() * x_camera + position; }
  Vec3 camera_from_world(const Vec3& x_world) const { return glm::transpose(rotation()) * (x_world - position); }

  bool operator==(const Pose&) const = default;
};

// Returns the pose at `eye` that looks at `target`, with the camera's y axis as close as possible to `down`. `eye` and
// `target` must differ, and the line between them must not be parallel to `down`.
Pose look_at(const Vec3& eye, const Vec3& target, const Vec3& down);

// An orientation for users, in degrees: right-handed rotations about the camera's axes, yaw first, R = Ry(yaw)
// Rx(pitch) Rz(roll). The axes are x right, y down and z forward. A positive yaw turns right, a positive pitch looks
// up, and a positive roll turns the camera clockwise (seen from behind). If all are zero, the camera is aligned with
// the world axes.
struct EulerAngles {
  double yaw = 0, pitch = 0, roll = 0;
};

Quat quat_from_euler(const EulerAngles& degrees);
// Returns yaw and roll in [-180, 180] and pitch in [-90, 90]. If the camera looks straight up or down, roll is 0 and
// yaw contains both rotations. quat_from_euler() of the result is the same orientation within 1e-14.
EulerAngles euler_from_quat(const Quat& orientation);

// Stores a depth for each part of a view, as a map of inverse distances. There is a node for every step x step pixels,
// with bilinear interpolation between nodes and constant values beyond the outer nodes. Node (i, j) is in the middle of
// its pixels, at ((i + 1/2) step - 1/2, (j + 1/2) step - 1/2).
struct FocalMap {
  static constexpr int kMaxStep = 64;  // pixels
  static constexpr size_t kMaxNodes = size_t{1} << 20;
  static constexpr int kMinStep = 4;
  Plane from;           // reference plane; distances are along its normal
  int step = kMinStep;  // pixels of the view
  int columns = 0, rows = 0;
  double farthest = 0, nearest = 0;  // inverse distances of levels 0 and 255, 1/m
  std::vector<uint8_t> levels;       // row by row
  // The depth maps of the cameras have found the surface, so each camera can tell whether something hides the surface
  // from it (see VisibilityMask).
  bool measured = false;

  static constexpr double kLevels = 255;

  static int nodes(int pixels, int step) { return (pixels + step - 1) / step; }
  // Returns a map for a view, without levels. Nodes are `step` pixels apart (kMinStep times a power of two), or farther
  // to stay within kMaxNodes.
  static FocalMap for_view(int width, int height, int step = kMinStep);
  double inverse_of(double level) const { return farthest + (nearest - farthest) * (level / kLevels); }
  // Returns the level nearest to an inverse distance, clamped to 0..255.
  uint8_t level_of(double inverse) const;
  // Returns the map that is used to render a view of this size. Its nodes are kMinStep pixels apart, interpolated
  // bilinearly and rounded to levels, so that all machines get the same bits. If the step is not a larger multiple of
  // kMinStep, the map is returned unchanged.
  FocalMap refined(int width, int height) const;
  double inverse_at(double x, double y) const;
  // Computes inverse distances at `count` positions of row y, from x on, `spacing` pixels apart.
  void inverse_row(double x, double spacing, double y, int count, float* out) const;
  // Returns the smallest and the largest node level that the depths at positions in [x0, x1] x [y0, y1] depend on.
  // `levels` may belong to this map or to another map of the same size.
  struct LevelRange {
    uint8_t least, largest;
  };
  LevelRange range_of(std::span<const uint8_t> levels, double x0, double y0, double x1, double y1) const;
  bool operator==(const FocalMap&) const = default;
};

// The surface of the scene that a view shows sharply: a plane, or a map with a distance for each pixel. A line of sight
// takes its colour from this surface.
struct FocalSurface {
  Plane plane;                          // chosen by the viewer; with a map, a fallback
  std::shared_ptr<const FocalMap> map;  // may be null

  bool operator==(const FocalSurface& o) const {
    return plane == o.plane && (map == o.map || (map && o.map && *map == *o.map));
  }
};

// Checks a focal surface that comes from the network or from a file. Throws Error ("focal_plane: ...", "focal_map:
// ...") if a number is not finite, if a normal is not of unit length, or if the map does not fit a view of width x
// height pixels.
void validate(const FocalSurface& surface, int width, int height);

}  // namespace lf
