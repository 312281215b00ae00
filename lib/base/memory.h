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

// An allocator whose resize() leaves new elements uninitialised.
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

// Tracks the largest size that was needed recently: within the last one to two minutes. Times are in nanoseconds of any
// clock. Not thread-safe.
class PeakTracker {
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
  size_t latest_ = 0, before_ = 0;  // largest sizes in the minute since began_ and in the minute before
};

// Keeps buffers for repeated use. Frees buffers with more than twice the size that was needed recently. `Memory` must
// have size() (bytes needed), capacity() (bytes allocated) and clear(), which keeps the allocation, like ByteBuffer.
// Thread-safe.
template <typename Memory>
class MemoryPool {
 public:
  static constexpr size_t kMaxPooled = 4;

  MemoryPool() { unused_.reserve(kMaxPooled); }  // so that give_back() never allocates
  // Returns the buffer that was used last, cleared, or an empty buffer.
  Memory take() {
    const std::lock_guard lock(mutex_);
    if (unused_.empty()) return {};
    Memory memory = std::move(unused_.back());
    unused_.pop_back();
    memory.clear();
    return memory;
  }
  // `now` is in nanoseconds of any clock, the same for all calls.
  void give_back(Memory memory, uint64_t now = now_ns()) {
    const std::lock_guard lock(mutex_);
    need_.see(memory.size(), now);
    if (unused_.size() < kMaxPooled) unused_.push_back(std::move(memory));
    drop_large(now);
  }
  // Frees buffers that have become too large.
  void trim(uint64_t now = now_ns()) {
    const std::lock_guard lock(mutex_);
    drop_large(now);
  }
  size_t pooled_bytes() const {
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
  PeakTracker need_;
  std::vector<Memory> unused_;
};

struct PoolDeleter {
  size_t capacity = 0;
  void operator()(uint8_t* memory) const;
};
using PooledBuffer = std::unique_ptr<uint8_t[], PoolDeleter>;

// Returns an uninitialised buffer of at least `size` bytes from a pool of the process, which keeps up to kPooledBytes
// of unused memory. Thread-safe.
PooledBuffer take_buffer(size_t size);

inline constexpr size_t kPooledBytes = size_t{256} << 20;

}  // namespace lf
