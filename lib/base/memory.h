// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <memory>
#include <mutex>
#include <span>
#include <utility>
#include <vector>

#include "base/schedule.h"

namespace lf {

// An allocator for memory that is written before it is read: what resize() adds is left as it is. Zeros first would be
// one more pass over every answer (1.5 ms for the sums of a 1080p view on fresh pages).
template <typename T>
struct UninitializedAllocator : std::allocator<T> {
  template <typename U>
  struct rebind {
    using other = UninitializedAllocator<U>;
  };
  template <typename U>
  void construct(U* p) {
    ::new (static_cast<void*>(p)) U;
  }
  template <typename U, typename... Args>
  void construct(U* p, Args&&... args) {
    ::new (static_cast<void*>(p)) U(std::forward<Args>(args)...);
  }
};

template <typename T>
using UninitializedVector = std::vector<T, UninitializedAllocator<T>>;
using ByteBuffer = UninitializedVector<uint8_t>;

inline void append(ByteBuffer& out, std::span<const uint8_t> bytes) {
  if (bytes.empty()) return;
  out.resize(out.size() + bytes.size());
  std::memcpy(out.data() + out.size() - bytes.size(), bytes.data(), bytes.size());
}

// The largest of the sizes that were needed within the last minute, a minute more at most: memory that is kept for what
// comes next need not be larger. Times in nanoseconds of any one clock. Not thread-safe.
class PeakNeed {
 public:
  static constexpr uint64_t kMinute = 60'000'000'000;

  void see(size_t size, uint64_t now) {
    pass(now);
    latest_ = std::max(latest_, size);
  }
  size_t largest(uint64_t now) {
    pass(now);
    return std::max(latest_, before_);
  }

 private:
  void pass(uint64_t now) {
    if (now < began_ + kMinute) return;
    before_ = now < began_ + 2 * kMinute ? latest_ : 0;
    latest_ = 0;
    began_ = now;
  }

  uint64_t began_ = 0;
  size_t latest_ = 0, before_ = 0;  // largest sizes in the minute that began at began_, and in the one before
};

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

// Memory that goes back to the pool when its owner lets go of it.
struct GiveBack {
  size_t capacity = 0;
  void operator()(uint8_t* memory) const;
};
using PooledBuffer = std::unique_ptr<uint8_t[], GiveBack>;

// A buffer of at least `size` bytes, not initialised: it holds whatever its last owner left there. Every frame of every
// camera needs a few hundred kB for a moment; fresh pages each time would cost more than decoding a small region. The
// process keeps up to kPooledBytes of unused memory. Thread-safe.
PooledBuffer take_buffer(size_t size);

inline constexpr size_t kPooledBytes = size_t{256} << 20;

}  // namespace lf
