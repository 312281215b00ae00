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

}  // namespace lf::scene
