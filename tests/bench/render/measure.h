// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <time.h>

#include <vector>

#include "bench/render/method.h"
#include "bench/render/row.h"

namespace lf::bench {

// What a clock shows.
double seconds(clockid_t clock);

// How long to measure one situation: until all methods have had `repeats` turns; 0: until `seconds` are over, but at
// least three turns.
struct Timing {
  int repeats = 0;
  double seconds = 6;
};

// One row each method. They take turns, so that all see the same disturbances, and the shortest turn counts: processor
// time of the thread where one works, else time on the clock.
std::vector<Row> measure(const Scene& scene, const std::vector<MethodKind>& kinds, const Timing& timing);

}  // namespace lf::bench
