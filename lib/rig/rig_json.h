// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <string>

#include <nlohmann/json_fwd.hpp>

#include "rig/rig.h"

namespace lf {

// rig.json ("format": "lightfield-rig", "version": 1), see docs/reference/files.md. Every error contains the file and
// the place in the file: "FILE: cameras[3].params[0]: must be a finite number".

// Throws Error. Sets Rig::directory to the file's folder.
Rig load_rig(const std::string& path);
// `name` is the file name in messages; `directory` becomes Rig::directory.
Rig parse_rig(const std::string& text, const std::string& name, const std::string& directory = "");

// Writes the rig. If `original` (a parsed rig file) is given, keeps its unknown keys: top-level keys, and the keys of
// each camera with the same id. Throws Error if a name or a location is not UTF-8 or the file cannot be written.
void save_rig(const Rig& rig, const std::string& path, const nlohmann::json* original = nullptr);
// Calls save_rig() with the current content of the rig file `original_path`.
void save_rig_like(const std::string& original_path, const Rig& rig, const std::string& path);
std::string rig_to_json(const Rig& rig, const nlohmann::json* original = nullptr);

// Settings to apply to a camera if its source supports them, by name: a number, or nullopt ("auto" in the file). Known
// names and units: exposure (seconds), gain and focus (units of the source), white_balance (kelvin), mains_frequency
// (hertz; 0: no lamps). Other names and units are specific to the source.
using Controls = std::map<std::string, std::optional<double>>;

// Returns the "controls" of a rig file by camera id; they are not part of Rig. Cameras without controls are omitted.
// Throws Error with the place ("FILE: cameras[3].controls.gain: ...").
std::map<uint32_t, Controls> parse_controls(const nlohmann::json& rig, const std::string& name);
std::map<uint32_t, Controls> load_controls(const std::string& path);

// Writes controls into a parsed rig file, for save_rig(). Cameras that are not in `controls` keep their controls.
void put_controls(const std::map<uint32_t, Controls>& controls, nlohmann::json& rig);

// Swaps the devices of two cameras in a parsed rig file. Source, lens, size, controls and unknown keys are exchanged;
// id, name, position and orientation stay. Throws Error for an unknown id.
void swap_devices(nlohmann::json& rig, uint32_t a, uint32_t b);

}  // namespace lf
