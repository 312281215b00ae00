// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <algorithm>
#include <set>
#include <string>

#include "base/text.h"
#include "rig/rig.h"

// Checks a name that becomes a file name. It must not contain a path or a pattern, and must be unique.
// Throws Error that names `place`.
inline void check_file_name(const std::string& name, const std::string& place, std::set<std::string>& taken) {
  if (name.empty() || name == "." || name == ".." || name.find_first_of("/%") != std::string::npos)
    throw lf::Error(place + ": \"" + name + "\" can't be the name of a file");
  if (!taken.insert(name).second) throw lf::Error(place + ": \"" + name + "\" is not unique");
}

// Converts a camera name to the name of a single file. COLMAP names may contain folders.
inline std::string flat_file_name(std::string name) {
  std::ranges::replace_if(
      name, [](unsigned char c) { return c == '/' || c < ' '; }, '_');
  return name == "." || name == ".." ? "_" + name : name;
}

inline void check_file_names(const lf::Rig& rig) {
  std::set<std::string> taken;
  for (size_t i = 0; i < rig.cameras.size(); i++)
    check_file_name(rig.cameras[i].name, "cameras[" + std::to_string(i) + "].name", taken);
}
