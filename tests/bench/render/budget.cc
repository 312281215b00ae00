// SPDX-License-Identifier: LGPL-2.1-or-later
#include "bench/render/budget.h"

#include <cstdio>
#include <utility>

#include "bench/render/row.h"

namespace lf::bench {

bool print_budget() {
  SceneOptions options;
  const Scene natural(options);
  options.content = "checkerboard";
  const Scene checkerboard(options);
  const std::string situation = label(options);
  std::printf("Each step on its own: %s\n%-44s %-7s | %21s | %21s |\n%-44s %-7s | %10s %10s | %10s %10s | %10s\n",
              situation.substr(situation.find(' ') + 1).c_str(), "", "", "natural", "checkerboard", "term", "unit",
              "max", "rms", "max", "rms", "bound");
  bool all = true;
  std::vector<Term> terms = plain_terms();
  for (Term& term : simd_terms()) terms.push_back(std::move(term));
  for (const Term& term : terms) {
    const Spread a = term.measure(natural), b = term.measure(checkerboard);
    std::printf("%-44s %-7s | %10.2g %10.2g | %10.2g %10.2g | ", term.name.c_str(), term.unit.c_str(), a.max, a.rms,
                b.max, b.rms);
    const bool broken = term.bound > 0 && !(a.max <= term.bound && b.max <= term.bound);
    if (term.bound > 0)
      std::printf("%10.2g%s\n", term.bound, broken ? " BROKEN" : "");
    else
      std::printf("%10s\n", "-");
    all = all && !broken;
  }
  return all;
}

}  // namespace lf::bench
