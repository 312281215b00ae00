// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <set>
#include <string>
#include <string_view>
#include <vector>

#include <nlohmann/json_fwd.hpp>

namespace lf {

// Checks the keys of another program's file, in every object of it.
//
// Some keys change the meaning of others: they select a fisheye or a panoramic lens, skew, a rolling shutter or other
// axes. No importer reads these keys, so any value but a neutral one (false, 0, null, "", "none") throws Error with
// file, place, key and a remedy. The same holds for keys that name a lens model other than a pinhole with radial and
// tangential distortion.
//
// Returns a note that lists the keys that are neither in `known` nor dangerous, or nothing. `known` holds what the
// importer reads and what does not matter to a rig. `path` stands for the file in messages.
std::vector<std::string> check_foreign_keys(const nlohmann::json& root, const std::string& path,
                                            const std::set<std::string_view>& known);

// What to do about a lens that no rig can hold; ends messages.
extern const char kUndistortRemedy[];

}  // namespace lf
