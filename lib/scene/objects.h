// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <vector>

#include <glm/mat3x3.hpp>
#include <glm/vec3.hpp>

namespace lf::scene {

// The objects of the built-in scene at one instant, in world axes (x right, y down, z forward) and metres. Float is
// accurate enough for a room of a few metres (1e-6 m).
using V3 = glm::vec3;

// The room contains everything, so that every ray hits something. Its floor is at kFloor = kRoomMax.y.
inline constexpr V3 kRoomMin{-2.7f, -1.75f, -2.5f}, kRoomMax{2.7f, 0.6f, 5.0f};
inline constexpr float kFloor = 0.6f;

enum class Texture : uint8_t {
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
  Texture texture;
  glm::mat3 local_from_world{1.0f};
};

// A segment from `base` to base + axis, thickened by `radius`.
struct Capsule {
  V3 base, axis;
  float radius;
  Texture texture;
};

// An upright cylinder from y = bottom up to y = top < bottom.
struct Cylinder {
  float x, z, radius, top, bottom;
  Texture texture;
};

// A box that is turned about the vertical, so that its x axis points along (cosine, 0, sine) in the world.
struct Box {
  V3 centre, half;
  float radius;
  float cosine, sine;
  Texture texture;
};

// The spheres and capsules [first, last) inside one bounding sphere. Rays that miss this sphere skip the group.
struct Group {
  V3 centre;
  float radius;
  uint32_t first_sphere, last_sphere, first_capsule, last_capsule;
};

struct Objects {
  std::vector<Sphere> spheres;
  std::vector<Capsule> capsules;
  std::vector<Cylinder> cylinders;
  std::vector<Box> boxes;
  std::vector<Group> groups;  // each sphere and capsule is in exactly one group

  // Closes a group that started at these numbers of spheres and capsules.
  void add_group(size_t first_sphere, size_t first_capsule);
};

Objects objects_at(double time);

void add_figure(double time, Objects& objects);

// The functions below are periodic patterns, averaged over a filter width `w`, which is the width of a pixel in units
// of the coordinate. The averages are computed in closed form, so that fine textures do not alias at one ray per pixel.
// libm is not used, so that every machine renders the same scene.

// Returns the nearest integer, for |x| < 2^22.
inline float nearest(float x) {
  constexpr float kShift = 12582912.0f;  // 1.5 * 2^23: sums near it have no fraction bits left
  return (x + kShift) - kShift;
}

inline float floor_of(float x) {
  const float n = nearest(x);
  return n > x ? n - 1 : n;
}

// Rises smoothly from 0 below `low` to 1 above `high`.
inline float ramp(float low, float high, float x) {
  const float t = std::clamp((x - low) / (high - low), 0.0f, 1.0f);
  return t * t * (3 - 2 * t);
}

// Returns cos(2 pi x) with an error below 2e-4.
inline float cos_turns(float x) {
  const float s = 6.2831853f * (0.25f - std::abs(x - nearest(x)));
  const float q = s * s;
  return s * (1 + q * (-1.0f / 6 + q * (1.0f / 120 + q * (-1.0f / 5040))));
}

// Returns the amplitude of a sine after averaging over `w` periods: sin(pi w) / (pi w), and 0 from the first zero on.
inline float filtered_amplitude(float w) {
  if (w >= 1) return 0;
  const float q = w * w;
  return std::max(0.0f, 1 + q * (-1.6449341f + q * (0.8117424f + q * (-0.1907518f + q * 0.0238f))));
}

// Returns a cosine of period 1.
inline float wave(float x, float w) { return cos_turns(x) * filtered_amplitude(w); }

// Returns the fraction of the interval of width `w` around x that lies in {fraction(x) < duty}.
inline float stripes(float x, float w, float duty) {
  w = std::max(w, 1e-4f);
  const auto integral = [duty](float v) {
    const float n = floor_of(v);
    return n * duty + std::min(v - n, duty);
  };
  return (integral(x + w / 2) - integral(x - w / 2)) / w;
}

// Returns the fraction of the rectangle of wu x wv around (u, v) that lies on one colour of a chequerboard of side 1:
// the colour of the field that contains (0.5, 0.5).
inline float checker(float u, float wu, float v, float wv) {
  // a and b are square waves between -1 and 1 of period 2. Their product is the chequerboard, and their averages
  // multiply.
  const float a = 2 * stripes(u / 2, wu / 2, 0.5f) - 1, b = 2 * stripes(v / 2, wv / 2, 0.5f) - 1;
  return 0.5f + 0.5f * a * b;
}

// Returns an irregular texture in -1..1: the sum of waves of unrelated directions, the coarsest of about 1 period per
// unit.
inline float noise_texture(float u, float wu, float v, float wv) {
  return 0.30f * wave(0.9f * u + 0.4f * v, 0.9f * wu + 0.4f * wv) +
         0.25f * wave(1.7f * v - 0.8f * u + 0.3f, 1.7f * wv + 0.8f * wu) +
         0.20f * wave(2.9f * u + 1.3f * v + 0.7f, 2.9f * wu + 1.3f * wv) +
         0.25f * wave(4.3f * u - 3.7f * v + 0.1f, 4.3f * wu + 3.7f * wv);
}

inline float hash_unit(int a, int b) {
  uint32_t h = static_cast<uint32_t>(a) * 0x9E3779B1u ^ static_cast<uint32_t>(b) * 0x85EBCA77u;
  h = (h ^ (h >> 15)) * 0x2C1B3C6Du;
  h ^= h >> 13;
  return static_cast<float>(h & 0xFFFF) / 65535.0f;
}

// A point on an object with the footprint of its pixel. The footprint is a parallelogram of `dx` and `dy`, tangent to
// the surface, in world axes and metres. If it is zero, textures are not filtered.
struct Surface {
  V3 point, normal, dx, dy;
};

// How a surface point reflects light, in linear light from 0 to 1.
struct Material {
  V3 albedo;
  float gloss = 0;  // strength of the highlight
};

enum class Kind : uint8_t { kNothing, kRoom, kSphere, kCapsule, kCylinder, kBox };

// Returns the material of a surface point. `index` is the number of the object among the objects of this kind. For
// kRoom it is the face: -x, +x, -y, +y (floor), -z, +z (back wall).
Material texture(const Objects& objects, Kind kind, uint32_t index, const Surface& surface);

}  // namespace lf::scene
