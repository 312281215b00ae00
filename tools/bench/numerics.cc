// SPDX-License-Identifier: LGPL-2.1-or-later
#include "bench/numerics.h"

#include <cstdio>

#include "reference/numerics.h"

namespace lf::bench {

bool print_numerics() {
  const std::vector<reference::Subject> subjects = reference::subjects();
  reference::print_heading(subjects);
  bool all = true;
  for (const reference::HardCase& hard : reference::hard_cases()) {
    const std::vector<reference::Measured> measured = measure(hard, subjects);
    print_row(hard, measured);
    for (size_t i = 0; i < subjects.size(); i++) {
      if (is_within(measured[i], subjects[i])) continue;
      std::printf("  BEYOND the bounds of %s\n", subjects[i].name.c_str());
      all = false;
    }
  }
  return all;
}

}  // namespace lf::bench
