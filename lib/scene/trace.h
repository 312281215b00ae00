// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <span>
#include <vector>

#include "scene/objects.h"

namespace lf::scene {

// The objects that move between some instants, so that pixels without a change need not be traced again.
struct SceneChange {
  std::vector<bool> spheres, capsules, cylinders, boxes;

  // Contains the changed objects at all instants. Each object is inside one ball or rod, and everything is inside
  // `around`.
  struct Part {
    Sphere around;
    std::vector<Sphere> balls;
    std::vector<Capsule> rods;
  };
  std::vector<Part> parts;
};

// Returns what changes between the first and any later one of some successive instants.
SceneChange scene_change(std::span<const Objects> instants);

// A line of sight. Textures are averaged over the pixel, so the ray also has the directions to neighbouring samples.
struct Ray {
  V3 origin, direction;         // unit length
  V3 dx{0, 0, 0}, dy{0, 0, 0};  // change of direction from one sample to the next
};

struct Hit {
  float t = 0;  // along the ray, metres
  Kind kind = Kind::kNothing;
  uint32_t index = 0;
  V3 normal{0, 0, 0};  // towards the ray's side, unit length
};

// Returns the nearest surface in front of the ray's origin. The result is kNothing only for rays from outside that miss
// the room.
Hit intersect_scene(const Objects& objects, const Ray& ray);

// Returns the fraction 0..1 of a round light that `point` sees. The light is along the unit vector `direction` at
// `distance`, and its radius is `spread` per metre of distance. The object (kind, index) casts no shadow on itself. The
// result is approximate, because penumbras are computed at the nearest approach to each object.
float light_visibility(const Objects& objects, const V3& point, const V3& direction, float distance, float spread,
                       Kind kind, uint32_t index);

// The point that a ray has hit, to find out later whether its light has changed.
struct HitPoint {
  V3 point;
  Kind kind = Kind::kNothing;
  bool is_lit = false;  // the surface faces the light but may be in shadow
  uint32_t index = 0;
};

struct TraceResult {
  V3 light;         // linear, 0..1 and above
  uint32_t object;  // differs between objects and between faces of the room
  HitPoint sight;
};

// Remembers the shadows within one pixel.
class ShadowCache {
 public:
  // Returns the fraction of `light` (number 0 or 1) that `object` sees in this pixel. Calls `find` on first use.
  template <typename Find>
  float seen(int light, uint32_t object, Find&& find) {
    for (int i = 0; i < count_; i++)
      if (entries_[i].object == object && entries_[i].light == light) return entries_[i].seen;
    const float seen = find();
    if (count_ < kEntries) entries_[count_++] = {object, light, seen};
    return seen;
  }

 private:
  static constexpr int kEntries = 6;
  struct Entry {
    uint32_t object;
    int light;
    float seen;
  } entries_[kEntries];
  int count_ = 0;
};

// `shadows` must belong to the pixel of this ray.
TraceResult trace(const Objects& objects, const Ray& ray, ShadowCache& shadows);

// `sight` is the hit point of a ray from `origin` before the movement. Returns true if the ray sees the same light
// after the movement. May return false for an unchanged ray, which only costs time.
bool is_unchanged(const SceneChange& movement, const V3& origin, const HitPoint& sight);

}  // namespace lf::scene
