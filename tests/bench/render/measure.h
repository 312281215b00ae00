// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <utility>
#include <vector>

#include <time.h>

#include "bench/render/methods.h"
#include "bench/render/rows.h"

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

// One situation and what is measured in it.
struct Configuration {
  SceneOptions scene;
  MethodOptions methods;
  Timing timing;
};

struct PlanOptions {
  bool full = false, acceptance = false;
  std::vector<std::pair<int, int>> sizes = {{320, 240}, {640, 480}, {1280, 720}, {1920, 1080}};
  std::vector<int> cameras, threads, qualities;  // empty: as many as the plan has
  int repeats = 0;
};

std::vector<Configuration> make_plan(const PlanOptions& options);

// Measures all terms of the error budget (docs/error-budget.md) on a natural picture and on a 1-pixel checkerboard.
// False if a bound is broken: it is marked.
bool print_budget();

}  // namespace lf::bench
