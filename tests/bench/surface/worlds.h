// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <string>
#include <vector>

#include "bench/surface/cases.h"

namespace lf::focus {

// Small scenes that are hard for what finds focal surfaces, each for one reason; in front of the array of scene_rig(),
// within the depths of the built-in scene.
std::vector<std::string> world_names();
// One of them by its name, seen from between the cameras. Throws Error if there is none of that name.
Case world_case(const std::string& name, int views);
// What any camera sees of one: four rays a pixel.
Image film_world(const std::string& name, const Lens& lens, const Pose& pose, int width, int height);

}  // namespace lf::focus
