// SPDX-License-Identifier: LGPL-2.1-or-later
// A new method is a file with a function add_x(), declared and called here.
#include "bench/render/method.h"

namespace lf::bench {

void add_opencv(const MethodOptions& options, std::vector<MethodKind>& kinds);
void add_nodes(const MethodOptions& options, std::vector<MethodKind>& kinds);

std::vector<MethodKind> methods(const MethodOptions& options) {
  std::vector<MethodKind> kinds;
  add_opencv(options, kinds);
  add_nodes(options, kinds);
  return kinds;
}

}  // namespace lf::bench
