// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstdint>
#include <map>
#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <string>

namespace lf {

// What a camera is set to where its source takes it, by name: a number, or nothing ("auto" in the file) where the
// camera decides by itself. Known names and units: exposure (seconds), gain and focus (the source's own), white_balance
// (kelvin), mains_frequency (hertz; 0: no lamps). Any other is the source's own name, with its units.
using Controls = std::map<std::string, std::optional<double>>;

// "controls" of the cameras of a rig file, which Rig does not hold, by the cameras' ids; cameras without are not there.
// Throws Error naming the place ("FILE: cameras[3].controls.gain: ...").
std::map<uint32_t, Controls> parse_controls(const nlohmann::json& rig, const std::string& name);
std::map<uint32_t, Controls> load_controls(const std::string& path);

// Puts them into a parsed rig file, for save_rig() to keep: those of cameras that are not in `controls` stay.
void put_controls(const std::map<uint32_t, Controls>& controls, nlohmann::json& rig);

}  // namespace lf
