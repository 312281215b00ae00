// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <string>

#include <nlohmann/json_fwd.hpp>

#include "rig/rig.h"

namespace lf {

// rig.json ("format": "lightfield-rig", "version": 1), see docs/guide-cameras.md. Every error names the file and the
// place in it: "FILE: cameras[3].params[0]: must be a finite number".

// Throws Error. Sets Rig::directory to the file's folder.
Rig load_rig(const std::string& path);
// `name` stands for the file in messages; `directory` becomes Rig::directory.
Rig parse_rig(const std::string& text, const std::string& name, const std::string& directory = "");

// Writes the rig. Where `original` (a parsed rig file) is given, keys that this version does not know are kept from it:
// top-level ones, and those of each camera with the same id. Throws Error if a name or a location is not UTF-8
// or the file can't be written.
void save_rig(const Rig& rig, const std::string& path, const nlohmann::json* original = nullptr);
// The same, where the original is what is in a rig file now.
void save_rig_like(const std::string& original_path, const Rig& rig, const std::string& path);
std::string rig_to_json(const Rig& rig, const nlohmann::json* original = nullptr);

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

// Two cameras of a parsed rig file were taken for each other: what belongs to the device (its source, lens, size,
// controls and whatever else the file has of it) goes to the other place, and id, name, position and orientation stay.
// Throws Error for an id that no camera has.
void swap_devices(nlohmann::json& rig, uint32_t a, uint32_t b);

}  // namespace lf
