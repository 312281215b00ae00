// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstddef>
#include <functional>

namespace lf {

// Calls task(0) .. task(count - 1), each once, in any order and from any threads, and returns when all are done. An
// exception of one of them is thrown again in the caller, after the others.
using ParallelFor = std::function<void(size_t count, const std::function<void(size_t)>& task)>;

inline void serial_for(size_t count, const std::function<void(size_t)>& task) {
  for (size_t i = 0; i < count; i++) task(i);
}

}  // namespace lf
