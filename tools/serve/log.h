// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <string>

namespace lf::serve {

// A line for whoever runs the server, of what others make it say: printable ASCII alone, of at most kLongestLine
// characters, and no more lines than a person reads: those left away are counted, and the number is said with the next.
// Thread-safe.
void say(const std::string& line);

inline constexpr size_t kLongestLine = 200;
inline constexpr double kLinesPerSecond = 5, kLinesAtOnce = 100;

// A line as say() writes it.
std::string printable(const std::string& line);

}  // namespace lf::serve
