// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <bit>
#include <cstdint>
#include <cstring>

namespace lf::jpeg {

// Bits of unstuffed entropy-coded bytes, most significant first. Knows no end: eight readable bytes have to follow
// whatever is read, and whoever reads compares position() with where the data ends.
class BitReader {
 public:
  BitReader(const uint8_t* bytes, uint64_t bit) : base_(bytes), next_(bytes + bit / 8) {
    refill();
    skip(bit % 8);
  }

  // Makes at least 56 bits available.
  void refill() {
    uint64_t word;
    std::memcpy(&word, next_, 8);
    if constexpr (std::endian::native == std::endian::little) word = __builtin_bswap64(word);
    buffer_ |= word >> available_;
    next_ += (63 - available_) >> 3;
    available_ |= 56;
  }
  // The next `bits` bits, 1..32.
  uint32_t peek(int bits) const { return static_cast<uint32_t>(buffer_ >> (64 - bits)); }
  // All bits that are available, the next one on top; below the last one anything may follow.
  uint64_t buffer() const { return buffer_; }
  // bits < 64, and no more than are available.
  void skip(unsigned bits) {
    buffer_ <<= bits;
    available_ -= bits;
  }
  // Bits read since `bytes`.
  uint64_t position() const { return static_cast<uint64_t>(next_ - base_) * 8 - available_; }

 private:
  const uint8_t* base_;
  const uint8_t* next_;
  uint64_t buffer_ = 0;
  unsigned available_ = 0;
};

}  // namespace lf::jpeg
