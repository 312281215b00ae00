// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstdint>
#include <nlohmann/json_fwd.hpp>

namespace lf {

// Two cameras of a parsed rig file were taken for each other: what belongs to the device (its source, lens, size,
// controls and whatever else the file has of it) goes to the other place, and id, name, position and orientation stay.
// Throws Error for an id that no camera has.
void swap_devices(nlohmann::json& rig, uint32_t a, uint32_t b);

}  // namespace lf
