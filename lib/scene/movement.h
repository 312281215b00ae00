// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <vector>

#include "scene/objects.h"

namespace lf::scene {

// What differs between two instants of the scene.
struct Movement {
  // Whether the object of this index does.
  std::vector<bool> spheres, capsules, pillars, blocks;

  // Objects that differ: each is inside of one of the balls or rods at both instants, and all are inside of `around`.
  struct Part {
    Sphere around;
    std::vector<Sphere> balls;
    std::vector<Capsule> rods;
  };
  std::vector<Part> parts;
};

Movement movement_between(const Objects& before, const Objects& after);

}  // namespace lf::scene
