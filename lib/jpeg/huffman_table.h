// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <array>
#include <cstdint>
#include <memory>

#include "jpeg/huffman_spec.h"

namespace lf::jpeg {

// What one code of any length says.
struct HuffmanSymbol {
  uint8_t code_bits = 0;  // 0: no code
  uint8_t symbol = 0;
};

// Codes too long for a lookup table are found by comparing (T.81 annex F.2.2.3).
class LongCodes {
 public:
  // `spec` has to be a prefix code.
  explicit LongCodes(const HuffmanSpec& spec);
  // `next16`: the next 16 bits. Finds codes of any length.
  HuffmanSymbol find(uint32_t next16) const;

 private:
  std::array<uint32_t, 16> end_;    // the first number of 16 bits beyond the codes of i + 1 bits
  std::array<int32_t, 16> offset_;  // what takes a code of i + 1 bits to the index of its symbol
  std::array<uint8_t, 256> symbols_;
};

// DC codes. An entry is the answer to the next kBits bits, as packed fields; 0: a longer code, or none.
struct DcTable {
  static constexpr int kBits = 9;
  static unsigned total_bits(uint32_t entry) { return entry & 0xff; }  // bits of the code and the difference
  static unsigned code_bits(uint32_t entry) { return entry >> 8 & 0xff; }
  static unsigned size(uint32_t entry) { return entry >> 16; }  // bits of the difference, 0..11

  LongCodes long_codes;
  std::array<uint32_t, 1 << kBits> entries;
};

// AC codes. An entry tells of the next kBits bits at once what the first symbol in them is, and how far all symbols
// whose codes lie in them lead: to pass over a block takes a few lookups.
struct AcTable {
  static constexpr int kBits = 11;
  // The chain of symbols: bits of codes and values, coefficients passed (0..63), plus kEnd where it ends the block.
  static constexpr unsigned kEnd = 128;
  static constexpr unsigned kNone = 64;  // passes this many and takes no bits: no code, or a longer one
  static unsigned chain_bits(uint32_t entry) { return entry & 0xff; }
  static unsigned chain_steps(uint32_t entry) { return entry >> 8 & 0xff; }
  // The first symbol alone: coefficients passed (1..16, the last one has the value), kEnd or kNone.
  static unsigned code_bits(uint32_t entry) { return entry >> 16 & 15; }
  static unsigned size(uint32_t entry) { return entry >> 20 & 15; }  // bits of the value
  static unsigned steps(uint32_t entry) { return entry >> 24; }

  LongCodes long_codes;
  std::array<uint32_t, 1 << kBits> entries;

  // An entry holds one symbol with its value where both lie in the next kShortBits bits; else kNone.
  static constexpr int kShortBits = 10;
  static unsigned short_bits(uint32_t entry) { return entry & 0xff; }
  static unsigned short_steps(uint32_t entry) { return entry >> 8 & 0xff; }
  static int32_t short_value(uint32_t entry) { return static_cast<int32_t>(entry) >> 16; }
  std::array<uint32_t, 1 << kShortBits> shorts;
};

// The signed number of `size` bits (0..15) at the top of `bits` as T.81 codes it: a leading zero means negative.
inline int32_t signed_value(uint64_t bits, unsigned size) {
  const auto magnitude = static_cast<int32_t>(bits >> 1 >> (63 - size));
  const auto negative = static_cast<int32_t>(~(static_cast<int64_t>(bits) >> 63));
  return magnitude + (negative & (1 - (1 << size)));
}

// The table of a specification, made once and then shared: cameras send the same ones with every frame. Null if it is
// no prefix code or empty. Thread-safe.
std::shared_ptr<const DcTable> dc_table(const HuffmanSpec& spec);
std::shared_ptr<const AcTable> ac_table(const HuffmanSpec& spec);

}  // namespace lf::jpeg
