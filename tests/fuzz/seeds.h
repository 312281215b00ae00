// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <vector>

namespace lf::fuzz {

using Bytes = std::vector<uint8_t>;

// Returns initial inputs by target, made of real units, frames and files.
std::map<std::string, std::vector<Bytes>> seeds();

}  // namespace lf::fuzz
