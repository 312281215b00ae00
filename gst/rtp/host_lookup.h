// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <string>
#include <vector>

namespace lf {

// The addresses of a host, as numbers; an address is its own. Asks the network about a name, for kLookupSeconds at
// most, so that a change of state does not hang where nobody answers. Throws Error where nobody knows the name. Any
// thread.
inline constexpr int kLookupSeconds = 2;
std::vector<std::string> addresses_of(const std::string& host);

}  // namespace lf
