// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <algorithm>
#include <set>
#include <string>
#include <vector>

#include "base/text.h"
#include "rig/rig.h"

// Checks that `name` can be used as a file name, contains neither a path nor a pattern, and is not in `taken`. Adds the
// name to `taken`. Throws Error that begins with `place`.
inline void check_file_name(const std::string& name, const std::string& place, std::set<std::string>& taken) {
  if (name.empty() || name == "." || name == ".." || name.find_first_of("/%") != std::string::npos)
    throw lf::Error(place + ": \"" + name + "\" cannot be used as a file name, because it is empty or contains / or %");
  if (!taken.insert(name).second) throw lf::Error(place + ": \"" + name + "\" is also the name of another camera");
}

// Replaces characters of a camera name that a file name cannot contain. Names from COLMAP may contain folders, for
// example.
inline std::string flat_file_name(std::string name) {
  std::ranges::replace_if(
      name, [](unsigned char c) { return c == '/' || c < ' '; }, '_');
  return name == "." || name == ".." ? "_" + name : name;
}

// Returns a file name without ending for each camera name, in the same order. All file names differ: a number follows a
// name that is already in use.
inline std::vector<std::string> flat_file_names(const std::vector<std::string>& names) {
  std::vector<std::string> flat;
  for (const std::string& name : names) flat.push_back(flat_file_name(name));
  std::set<std::string> taken, all(flat.begin(), flat.end());
  for (std::string& name : flat) {
    const std::string first = name;
    for (int number = 2; !taken.insert(name).second; number++) {
      while (all.contains(first + "_" + std::to_string(number))) number++;
      name = first + "_" + std::to_string(number);
    }
  }
  return flat;
}

inline void check_file_names(const lf::Rig& rig) {
  std::set<std::string> taken;
  for (size_t i = 0; i < rig.cameras.size(); i++)
    check_file_name(rig.cameras[i].name, "cameras[" + std::to_string(i) + "].name", taken);
}
