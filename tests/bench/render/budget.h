// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <string>
#include <vector>

#include "bench/render/scene.h"

namespace lf::bench {

// One term of the error budget (docs/error-budget.md): what one step does on its own, everything before it exact.
struct Spread {
  double max = 0, rms = 0;
};
struct Term {
  std::string name, unit;
  double bound = 0;  // of `max`; 0: stated by no one
  Spread (*measure)(const Scene& scene);
};
// In the order in which a pixel meets them: those of the plan and of the cameras, and those of SIMD and JPEG.
std::vector<Term> plain_terms();
std::vector<Term> simd_terms();

// Measures them all on a natural picture and on a 1-pixel checkerboard. False if a bound is broken: it is marked.
bool print_budget();

}  // namespace lf::bench
