// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <utility>
#include <vector>

namespace lf::bench {

// The three random access cameras beside one another: bytes that travel to and from 64 cameras for a view of each size,
// and what it costs at the viewer, at the cameras and at the compositor. `repeats` renderings each, of which the
// shortest counts; 0: as many as fit two seconds.
void print_access(const std::vector<std::pair<int, int>>& sizes, int cameras, int repeats);

}  // namespace lf::bench
