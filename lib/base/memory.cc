// SPDX-License-Identifier: LGPL-2.1-or-later
#include "base/memory.h"

#include <map>
#include <mutex>
#include <vector>

namespace lf {
namespace {

// Capacities are rounded up, so that compressed frames of similar size can reuse each other's buffers.
constexpr size_t kStep = size_t{64} << 10;

struct Pool {
  std::mutex mutex;
  // Buffers by capacity, the latest last.
  std::map<size_t, std::vector<std::unique_ptr<uint8_t[]>>> unused;
  size_t bytes = 0;
};

// Never destroyed, because frames may outlive static objects.
Pool& pool() {
  static Pool* const the_pool = new Pool;
  return *the_pool;
}

}  // namespace

PooledBuffer take_buffer(size_t size) {
  const size_t capacity = (size + kStep - 1) / kStep * kStep;
  {
    Pool& p = pool();
    const std::lock_guard lock(p.mutex);
    const auto found = p.unused.find(capacity);
    if (found != p.unused.end() && !found->second.empty()) {
      uint8_t* const memory = found->second.back().release();
      found->second.pop_back();
      p.bytes -= capacity;
      return {memory, PoolDeleter{capacity}};
    }
  }
  return {new uint8_t[capacity], PoolDeleter{capacity}};
}

void PoolDeleter::operator()(uint8_t* memory) const {
  std::unique_ptr<uint8_t[]> owned(memory);
  Pool& p = pool();
  const std::lock_guard lock(p.mutex);
  if (p.bytes + capacity > kPooledBytes) return;
  p.unused[capacity].push_back(std::move(owned));
  p.bytes += capacity;
}

}  // namespace lf
