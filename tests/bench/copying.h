// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <thread>

#include "base/worker_pool.h"
#include "render/gl/sum_drawer.h"

namespace lf::bench {

// What goes to a card and comes from it is copied by all processors, as by a node; where those draw, too, by one.
inline ParallelFor copying_for(const gl::SumDrawer* card) {
  if (!card || card->is_software()) return serial_for;
  return [pool = WorkerPool::shared()](size_t count, const std::function<void(size_t)>& task) {
    pool->run(std::thread::hardware_concurrency(), count, task);
  };
}

}  // namespace lf::bench
