// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <string>

#include "bench/array.h"

namespace lf::bench {

// Renders one view of a fixed scene by the method of that label `times` times, inside a function "render_once" of which
// a profiler counts instructions. Throws Error if there is no such method; the message names those that there are.
void run_once(const std::string& method, const ArrayOptions& array, int times);

}  // namespace lf::bench
