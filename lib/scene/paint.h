// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include "scene/objects.h"

namespace lf::scene {

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

// `index` is of the object among those of its kind; for kRoom it is the face: -x, +x, -y, +y (floor), -z, +z (back
// wall).
Finish paint(const Objects& objects, Kind kind, uint32_t index, const Surface& surface);

}  // namespace lf::scene
