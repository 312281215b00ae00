// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

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

}  // namespace lf
