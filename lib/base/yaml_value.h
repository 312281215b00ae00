// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <string>

#include <nlohmann/json_fwd.hpp>

namespace lf {

// The first document of a YAML text as the JSON value that says the same, so that a JsonValue can read it and name the
// place of what is wrong. Plain scalars that are numbers become numbers; tags are dropped. Aliases, keys that are not
// scalars and keys that are there twice are refused. `name` stands for the file in messages; throws Error with the
// line.
nlohmann::json parse_yaml(const std::string& text, const std::string& name);

// A number that every reader of YAML takes for one: "400.0", "1.0e-09" (to PyYAML "1e-09" is a text).
std::string yaml_number(double value);

}  // namespace lf
