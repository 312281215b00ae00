// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <vector>

namespace lf::fuzz {

using Bytes = std::vector<uint8_t>;

// Inputs to begin with, made of real units, frames and files: by target.
std::map<std::string, std::vector<Bytes>> seeds();

}  // namespace lf::fuzz
