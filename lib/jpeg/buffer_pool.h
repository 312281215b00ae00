// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>

namespace lf::jpeg {

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

}  // namespace lf::jpeg
