// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <algorithm>
#include <cmath>
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

// Periodic patterns averaged over a filter width `w`, in units of the coordinate: the width of a pixel there. Averaging
// in closed form keeps fine texture free of aliasing at one ray per pixel. Own arithmetic in place of libm's, so that
// every machine films the same scene.

// Nearest integer, for |x| < 2^22.
inline float nearest(float x) {
  constexpr float kShift = 12582912.0f;  // 1.5 * 2^23: sums near it have no fraction bits left
  return (x + kShift) - kShift;
}

inline float floor_of(float x) {
  const float n = nearest(x);
  return n > x ? n - 1 : n;
}

// 0 below `low`, 1 above `high`, smooth between.
inline float ramp(float low, float high, float x) {
  const float t = std::clamp((x - low) / (high - low), 0.0f, 1.0f);
  return t * t * (3 - 2 * t);
}

// cos(2 pi x), error < 2e-4.
inline float cos_turns(float x) {
  const float s = 6.2831853f * (0.25f - std::abs(x - nearest(x)));  // cos(2 pi a) = sin(pi / 2 - 2 pi a)
  const float q = s * s;
  return s * (1 + q * (-1.0f / 6 + q * (1.0f / 120 + q * (-1.0f / 5040))));
}

// What averaging over `w` periods leaves of a sine's amplitude: sin(pi w) / (pi w), 0 from the first zero on.
inline float kept_amplitude(float w) {
  if (w >= 1) return 0;
  const float q = w * w;
  return std::max(0.0f, 1 + q * (-1.6449341f + q * (0.8117424f + q * (-0.1907518f + q * 0.0238f))));
}

// Cosine of period 1.
inline float wave(float x, float w) { return cos_turns(x) * kept_amplitude(w); }

// How much of the interval of width `w` around x lies in {fraction(x) < duty}.
inline float stripes(float x, float w, float duty) {
  w = std::max(w, 1e-4f);
  const auto integral = [duty](float v) {
    const float n = floor_of(v);
    return n * duty + std::min(v - n, duty);
  };
  return (integral(x + w / 2) - integral(x - w / 2)) / w;
}

// How much of the rectangle of wu x wv around (u, v) lies on the fields of a chequerboard of side 1 that hold (0.5,
// 0.5).
inline float checker(float u, float wu, float v, float wv) {
  // +-1 square waves of period 2; their product is the chequerboard and their averages multiply.
  const float a = 2 * stripes(u / 2, wu / 2, 0.5f) - 1, b = 2 * stripes(v / 2, wv / 2, 0.5f) - 1;
  return 0.5f + 0.5f * a * b;
}

// Irregular texture in -1..1: waves of unrelated directions, the coarsest of about 1 period per unit.
inline float grain(float u, float wu, float v, float wv) {
  return 0.30f * wave(0.9f * u + 0.4f * v, 0.9f * wu + 0.4f * wv) +
         0.25f * wave(1.7f * v - 0.8f * u + 0.3f, 1.7f * wv + 0.8f * wu) +
         0.20f * wave(2.9f * u + 1.3f * v + 0.7f, 2.9f * wu + 1.3f * wv) +
         0.25f * wave(4.3f * u - 3.7f * v + 0.1f, 4.3f * wu + 3.7f * wv);
}

// A number in 0..1 for each pair of integers.
inline float scatter(int a, int b) {
  uint32_t h = static_cast<uint32_t>(a) * 0x9E3779B1u ^ static_cast<uint32_t>(b) * 0x85EBCA77u;
  h = (h ^ (h >> 15)) * 0x2C1B3C6Du;
  h ^= h >> 13;
  return static_cast<float>(h & 0xFFFF) / 65535.0f;
}

// A point on an object and what a pixel covers there: its footprint is the parallelogram of `dx`, `dy`, tangent to the
// surface, world axes, metres. Zero footprint: textures are not filtered.
struct Surface {
  V3 point, normal, dx, dy;
};

// What light does at a surface point. Linear light, 0..1.
struct Finish {
  V3 albedo;
  float gloss = 0;  // strength of the highlight
};

enum class Kind : uint8_t { kNothing, kRoom, kSphere, kCapsule, kPillar, kBlock };

// `index` is the number of the object among those of its kind; for kRoom it is the face: -x, +x, -y, +y (floor), -z, +z
// (back wall).
Finish paint(const Objects& objects, Kind kind, uint32_t index, const Surface& surface);

}  // namespace lf::scene
