// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstdint>
#include <vector>

#include <glm/mat3x3.hpp>
#include <glm/vec3.hpp>

namespace lf::scene {

// What stands in the scene at one instant. World axes (x right, y down, z forward), metres; float is enough for a room
// of a few metres (1e-6 m).
using V3 = glm::vec3;

// The room: everything is inside it, so that no ray leaves to infinity. Its floor is at kFloor = kRoomMax.y.
inline constexpr V3 kRoomMin{-2.7f, -1.75f, -2.5f}, kRoomMax{2.7f, 0.6f, 5.0f};
inline constexpr float kFloor = 0.6f;

enum class Paint : uint8_t {
  kWood,
  kJoint,
  kEye,
  kBalloon,
  kGlobe,
  kBeachBall,
  kSwirl,
  kLeaves,
  kString,
  kPlinth,
  kTable,
  kPot,
  kColumn,
  kRings,
  kChequers,
  kCrate,
  kChart,
  kEasel,
};

struct Sphere {
  V3 centre;
  float radius;
  Paint paint;
  glm::mat3 local_from_world{1.0f};  // axes of the object's texture
};

// A segment from `base` to base + axis, thickened by `radius`.
struct Capsule {
  V3 base, axis;
  float radius;
  Paint paint;
};

// An upright cylinder from y = bottom up to y = top < bottom.
struct Pillar {
  float x, z, radius, top, bottom;
  Paint paint;
};

// A box turned about the vertical: its x axis points along (cosine, 0, sine) in the world.
struct Block {
  V3 centre, half;
  float radius;  // radius of the sphere around the block
  float cosine, sine;
  Paint paint;
};

// Spheres and capsules [first, last) that one bounding sphere holds.
struct Group {
  V3 centre;
  float radius;
  uint32_t first_sphere, last_sphere, first_capsule, last_capsule;
};

struct Objects {
  std::vector<Sphere> spheres;
  std::vector<Capsule> capsules;
  std::vector<Pillar> pillars;
  std::vector<Block> blocks;
  std::vector<Group> groups;  // every sphere and capsule is in exactly one

  // Closes a group that began when there were `spheres`, `capsules` of them.
  void add_group(size_t first_sphere, size_t first_capsule);
};

Objects objects_at(double time);

// The walking figure with its balloon; groups of its own are added.
void add_figure(double time, Objects& objects);

}  // namespace lf::scene
