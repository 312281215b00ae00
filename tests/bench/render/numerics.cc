// SPDX-License-Identifier: LGPL-2.1-or-later
#include "bench/render/numerics.h"

#include <cstdio>

#include "reference/numerics.h"

namespace lf::bench {
namespace {

bool print_case(const reference::HardCase& hard, const std::vector<reference::Subject>& subjects) {
  const std::vector<reference::Measured> measured = measure(hard, subjects);
  print_row(hard, measured);
  bool all = true;
  for (size_t i = 0; i < subjects.size(); i++) {
    if (is_within(measured[i], subjects[i])) continue;
    std::printf("  BEYOND the bounds of %s\n", subjects[i].name.c_str());
    all = false;
  }
  return all;
}

}  // namespace

bool print_numerics() {
  const std::vector<reference::Subject> subjects = reference::subjects();
  const std::vector<reference::HardCase> cases = reference::hard_cases();
  reference::print_heading(subjects);
  bool all = true;
  for (const reference::HardCase& hard : cases) all &= print_case(hard, subjects);
  std::printf("in pictures of %d times as many rows and columns\n", reference::kEnlarged);
  for (const reference::HardCase& hard : cases)
    all &= print_case(reference::enlarged(hard, reference::kEnlarged), subjects);
  return all;
}

}  // namespace lf::bench
