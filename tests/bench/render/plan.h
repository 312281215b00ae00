// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <utility>
#include <vector>

#include "bench/render/measure.h"

namespace lf::bench {

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

}  // namespace lf::bench
