// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <algorithm>
#include <set>
#include <string>

#include "base/text.h"
#include "rig/rig.h"

// Names become file names: they must not lead out of the folder, hide a pattern or name one file twice. Throws Error
// naming `place`.
inline void check_file_name(const std::string& name, const std::string& place, std::set<std::string>& taken) {
  if (name.empty() || name == "." || name == ".." || name.find_first_of("/%") != std::string::npos)
    throw lf::Error(place + ": \"" + name + "\" can't be the name of a file");
  if (!taken.insert(name).second) throw lf::Error(place + ": \"" + name + "\" names two of them");
}

// A camera's name as that of one file. COLMAP's names may have folders in them.
inline std::string flat_file_name(std::string name) {
  std::ranges::replace_if(name, [](unsigned char c) { return c == '/' || c < ' '; }, '_');
  return name == "." || name == ".." ? "_" + name : name;
}

// Those of a rig's cameras.
inline void check_file_names(const lf::Rig& rig) {
  std::set<std::string> taken;
  for (size_t i = 0; i < rig.cameras.size(); i++)
    check_file_name(rig.cameras[i].name, "cameras[" + std::to_string(i) + "].name", taken);
}
