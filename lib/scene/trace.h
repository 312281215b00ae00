// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <vector>

#include "scene/objects.h"

namespace lf::scene {

// The objects that differ between two instants of the scene.
struct Movement {
  // True at the index of each object that differs.
  std::vector<bool> spheres, capsules, pillars, blocks;

  // Bounds of such objects at both instants: each object is inside one ball or rod, and all are inside `around`.
  struct Part {
    Sphere around;
    std::vector<Sphere> balls;
    std::vector<Capsule> rods;
  };
  std::vector<Part> parts;
};

Movement movement_between(const Objects& before, const Objects& after);

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

// The nearest surface in front of the ray's origin; kNothing only for rays from outside that miss the room.
Hit first_hit(const Objects& objects, const Ray& ray);

// Fraction of a round light that `point` sees: it lies along the unit vector `direction`, as far as `distance`, and its
// radius grows by `spread` per metre of distance. The object (kind, index) itself casts no shadow: 0..1. Approximate:
// penumbras are those of the nearest approach to each object.
float light_seen(const Objects& objects, const V3& point, const V3& direction, float distance, float spread, Kind kind,
                 uint32_t index);

// A ray's hit point.
struct Sight {
  V3 point;
  Kind kind = Kind::kNothing;
  bool is_lit = false;  // the surface faces the light, which may be in shadow
  uint32_t index = 0;
};

struct Seen {
  V3 light;         // linear, 0..1 and above
  uint32_t object;  // differs from object to object and from face to face of the room
  Sight sight;
};

// Shadows of the objects met so far within one pixel. They are soft, so all samples of the pixel on one object share
// what the first of them found: shadows are most of the work.
class PixelShadows {
 public:
  // The fraction of `light` (0 or 1: its number) that `object` sees in this pixel, from `find` the first time.
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

// `shadows`: of this ray's pixel.
Seen trace(const Objects& objects, const Ray& ray, PixelShadows& shadows);

// Returns true if the ray from `origin` that hit `sight` before the movement sees the same light after the movement.
// Conservative: may return false for an unchanged ray.
bool is_unchanged(const Movement& movement, const V3& origin, const Sight& sight);

}  // namespace lf::scene
