// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <string>

#include <nlohmann/json_fwd.hpp>

#include "rig/rig.h"

namespace lf {

// Reads and writes rig.json ("format": "lightfield-rig", "version": 1; see docs/reference/files.md). Every error
// contains the file and the place in the file, for example "FILE: cameras[3].params[0]: must be a finite number".

// Reads a rig file. Rig::directory becomes the folder of the file, because paths in the file start from there. Throws
// Error.
Rig load_rig(const std::string& path);
// Parses the text of a rig file. `name` is the file name in error messages, and `directory` becomes Rig::directory.
Rig parse_rig(const std::string& text, const std::string& name, const std::string& directory = "");

// Returns true if the file can be read and has the format of a rig file. The cameras are not checked.
bool is_rig_file(const std::string& path);

// Writes a rig file. `original` is the parsed file that the rig was read from, so that keys which this version does not
// know are preserved. These are keys at the top level and keys of cameras with the same id. Throws Error if a name or a
// location is not UTF-8, or if the file cannot be written.
void save_rig(const Rig& rig, const std::string& path, const nlohmann::json* original = nullptr);
// Writes a rig file like save_rig(), and preserves the unknown keys of the rig file `original_path`.
void save_rig_like(const std::string& original_path, const Rig& rig, const std::string& path);
std::string rig_to_json(const Rig& rig, const nlohmann::json* original = nullptr);

// Settings for a camera, by name: a number, or nullopt for "auto" in the file. A setting is ignored if the camera's
// source does not support this control. The known names are exposure (seconds), gain and focus (units of the source),
// white_balance (kelvin) and mains_frequency (hertz; 0: no lamps). Other names and their units are specific to the
// source.
using Controls = std::map<std::string, std::optional<double>>;

// Return the "controls" of a rig file by camera id, without cameras that have none. (Controls are not part of Rig.)
// Throw Error with the place, for example "FILE: cameras[3].controls.gain: ...".
std::map<uint32_t, Controls> parse_controls(const nlohmann::json& rig, const std::string& name);
std::map<uint32_t, Controls> load_controls(const std::string& path);

// Writes controls into a parsed rig file, which can then be passed to save_rig(). Cameras that are not in `controls`
// keep their controls.
void put_controls(const std::map<uint32_t, Controls>& controls, nlohmann::json& rig);

// Swaps the devices of two cameras in a parsed rig file, for example after their cables were swapped. Source, lens,
// size, controls and unknown keys are exchanged; id, name, position and orientation stay. Throws Error for an unknown
// id.
void swap_devices(nlohmann::json& rig, uint32_t a, uint32_t b);

}  // namespace lf
