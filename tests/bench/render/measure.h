// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <utility>
#include <vector>

#include <time.h>

#include "bench/render/methods.h"
#include "bench/render/rows.h"

namespace lf::bench {

double seconds(clockid_t clock);

// Duration of a measurement: until all methods have had `repeats` turns; 0: for `seconds`, but at least three turns.
struct Timing {
  int repeats = 0;
  double seconds = 6;
};

// Returns one row per method. Methods run in turns, so that disturbances affect all alike, and the shortest turn
// counts: CPU time of the thread for single-threaded methods, otherwise wall-clock time.
std::vector<Row> measure(const Scene& scene, const std::vector<MethodKind>& kinds, const Timing& timing);

struct Configuration {
  SceneOptions scene;
  MethodOptions methods;
  Timing timing;
};

struct PlanOptions {
  bool full = false, acceptance = false;
  std::vector<std::pair<int, int>> sizes = {{320, 240}, {640, 480}, {1280, 720}, {1920, 1080}};
  std::vector<int> cameras, threads, qualities;  // empty: the plan's values
  int repeats = 0;
};

std::vector<Configuration> make_plan(const PlanOptions& options);

// Measures all terms of the error budget (docs/reference/error-budget.md) on a natural picture and on a 1-pixel checkerboard.
// Returns false and marks the term if a bound is exceeded.
bool print_budget();

}  // namespace lf::bench
