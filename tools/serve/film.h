// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <string>

namespace lf::serve {

// The rig file of a film of the built-in scene that loops, made by lf-scene where it is not there yet. Throws Error.
std::string film_of_scene();

}  // namespace lf::serve
