// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <span>

// What the targets share. Each defines LLVMFuzzerTestOneInput().
namespace lf::fuzz {

// What must be so, whatever comes.
inline void require(bool condition) {
  if (!condition) abort();
}

// Takes numbers off the front of the input, 0 where it has ended.
class Input {
 public:
  Input(const uint8_t* data, size_t size) : rest_(data, size) {}
  uint32_t number(int bytes) {
    uint32_t value = 0;
    for (const uint8_t byte : take(static_cast<size_t>(bytes))) value = value << 8 | byte;
    return value;
  }
  std::span<const uint8_t> take(size_t count) {
    const std::span<const uint8_t> out = rest_.first(std::min(count, rest_.size()));
    rest_ = rest_.subspan(out.size());
    return out;
  }
  bool empty() const { return rest_.empty(); }

 private:
  std::span<const uint8_t> rest_;
};

}  // namespace lf::fuzz
