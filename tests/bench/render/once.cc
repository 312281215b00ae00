// SPDX-License-Identifier: LGPL-2.1-or-later
#include "bench/render/once.h"

#include "base/error.h"
#include "bench/render/row.h"

// Its name is what callgrind is told to look for.
extern "C" [[gnu::noinline]] void render_once(lf::bench::Method* method) {
  method->render();
  asm volatile("");  // no tail call: it would leave the function before the work
}

namespace lf::bench {

void run_once(const std::string& name, const ArrayOptions& array, int times) {
  SceneOptions options;
  options.array = array;
  options.most_filmed_pixels = 2.0 * options.array.width * options.array.height;  // a simulated processor is slow
  MethodOptions all;
  all.all = true;
  std::string names;
  for (const MethodKind& kind : methods(all)) {
    if (label(kind.setting) != name) {
      names += (names.empty() ? "" : ", ") + label(kind.setting);
      continue;
    }
    const Scene scene(options);
    const auto method = kind.make(scene, scene.views().front());
    method->render();  // the first call also makes room and tables
    for (int i = 0; i < times; i++) render_once(method.get());
    return;
  }
  throw Error("no method \"" + name + "\"; there are " + names);
}

}  // namespace lf::bench
