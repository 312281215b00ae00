// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstddef>
#include <cstdint>
#include <mutex>
#include <utility>
#include <vector>

#include "base/peak_need.h"
#include "base/schedule.h"

namespace lf {

// Memory that is used again and again for the same purpose: megabytes cost more to get from the system anew each time
// than to fill. What is much larger than was needed within the last minute is given back to the system. `Memory` has
// size(), the bytes that were needed, capacity(), those that are there, and clear(), which leaves them there, as
// ByteBuffer has. Thread-safe.
template <typename Memory>
class KeptMemory {
 public:
  static constexpr size_t kMostKept = 4;

  KeptMemory() { unused_.reserve(kMostKept); }  // to give some back takes none
  // What was given back last, cleared, or an empty one.
  Memory take() {
    const std::lock_guard lock(mutex_);
    if (unused_.empty()) return {};
    Memory memory = std::move(unused_.back());
    unused_.pop_back();
    memory.clear();
    return memory;
  }
  // `now`: now_ns(), or of any one clock.
  void give_back(Memory memory, uint64_t now = now_ns()) {
    const std::lock_guard lock(mutex_);
    need_.see(memory.size(), now);
    if (unused_.size() < kMostKept) unused_.push_back(std::move(memory));
    drop_large(now);
  }
  // The minute passes: what was last needed before it goes. To be called now and then where nothing may come back.
  void trim(uint64_t now = now_ns()) {
    const std::lock_guard lock(mutex_);
    drop_large(now);
  }
  size_t kept_bytes() const {
    const std::lock_guard lock(mutex_);
    size_t bytes = 0;
    for (const Memory& memory : unused_) bytes += memory.capacity();
    return bytes;
  }

 private:
  void drop_large(uint64_t now) {
    const size_t most = 2 * need_.largest(now);
    std::erase_if(unused_, [most](const Memory& memory) { return memory.capacity() > most; });
  }

  mutable std::mutex mutex_;
  PeakNeed need_;
  std::vector<Memory> unused_;
};

}  // namespace lf
