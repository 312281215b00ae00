// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <array>
#include <cstdint>

#include "jpeg/bit_reader.h"
#include "jpeg/huffman_table.h"

// One 8x8 block of a baseline scan (T.81 annex F): read, or passed over, which takes no more than the lengths of its
// codes. Inline: BitReader has to stay in registers.
namespace lf::jpeg {

// Where coefficient k of the zigzag order lies in rows of 8.
inline constexpr std::array<uint8_t, 64> kNaturalOrder = {
    0,  1,  8,  16, 9,  2,  3,  10, 17, 24, 32, 25, 18, 11, 4,  5,  12, 19, 26, 33, 40, 48,
    41, 34, 27, 20, 13, 6,  7,  14, 21, 28, 35, 42, 49, 56, 57, 50, 43, 36, 29, 22, 15, 23,
    30, 37, 44, 51, 58, 59, 52, 45, 38, 31, 39, 46, 53, 60, 61, 54, 47, 55, 62, 63};

// The signed number of `size` bits (0..15) at the top of `bits` as T.81 codes it: a leading zero means negative.
inline int32_t signed_value(uint64_t bits, unsigned size) {
  const auto magnitude = static_cast<int32_t>(bits >> 1 >> (63 - size));
  const auto negative = static_cast<int32_t>(~(static_cast<int64_t>(bits) >> 63));
  return magnitude + (negative & (1 - (1 << size)));
}

// Adds the block's difference to the predictor; false if its code is none. Takes 27 bits at most.
inline bool read_dc(BitReader& reader, const DcTable& table, int32_t& predictor) {
  unsigned code_bits, size;
  const uint32_t entry = table.entries[reader.peek(DcTable::kBits)];
  if (entry != 0) [[likely]] {
    code_bits = DcTable::code_bits(entry);
    size = DcTable::size(entry);
  } else {
    const HuffmanSymbol found = table.long_codes.find(reader.peek(16));
    if (found.code_bits == 0 || found.symbol > 11) return false;
    code_bits = found.code_bits;
    size = found.symbol;
  }
  predictor += signed_value(reader.buffer() << code_bits, size);
  reader.skip(entry != 0 ? DcTable::total_bits(entry) : code_bits + size);
  return true;
}

// One AC symbol at the reader; the fields of AcTable.
struct AcSymbol {
  unsigned steps, code_bits, size;
};
inline AcSymbol find_ac(const BitReader& reader, const AcTable& table) {
  const uint32_t entry = table.entries[reader.peek(AcTable::kBits)];
  if (AcTable::steps(entry) != AcTable::kNone) [[likely]]
    return {AcTable::steps(entry), AcTable::code_bits(entry), AcTable::size(entry)};
  const HuffmanSymbol found = table.long_codes.find(reader.peek(16));
  const unsigned run = found.symbol >> 4, size = found.symbol & 15u;
  if (found.code_bits == 0 || (size == 0 && run != 0 && run != 15)) return {AcTable::kNone, 0, 0};
  return {found.symbol == 0 ? AcTable::kEnd : run + 1, found.code_bits, size};
}

// Passes over the AC coefficients of a block; false if they are damaged. The reader has been refilled since the last
// block and has given 27 bits at most since then. It leaves the reader to be refilled.
inline bool skip_ac(BitReader& reader, const AcTable& table) {
  for (unsigned k = 1;;) {
    // A chain that leads beyond the last coefficient, to the end of the block or nowhere leaves this loop: the only
    // jump that depends on the data. Two lookups of at most 12 + 15 bits lie between refills.
    uint32_t entry;
    unsigned to;
    for (;;) {
      entry = table.entries[reader.peek(AcTable::kBits)];
      to = k + AcTable::chain_steps(entry);
      if (to >= 64) break;
      reader.skip(AcTable::chain_bits(entry));
      k = to;
      reader.refill();
      entry = table.entries[reader.peek(AcTable::kBits)];
      to = k + AcTable::chain_steps(entry);
      if (to >= 64) break;
      reader.skip(AcTable::chain_bits(entry));
      k = to;
    }
    if (to - AcTable::kEnd < 64) [[likely]] {
      reader.skip(AcTable::chain_bits(entry));
      return true;
    }
    // One symbol by itself: a long code, or the chain goes on in the next block.
    reader.refill();
    const AcSymbol symbol = find_ac(reader, table);
    if (symbol.steps == AcTable::kNone) return false;
    reader.skip(symbol.code_bits + symbol.size);
    if (symbol.steps == AcTable::kEnd) return true;
    k += symbol.steps;
    if (k >= 64) return k == 64;
    reader.refill();
  }
}

// Reads the AC coefficients of a block times `quant` (zigzag order) into `block` (natural order), which has to be zero.
// False if they are damaged. *last: the index of the last one in zigzag order, 0 without any. Takes a reader just
// refilled, leaves it to be refilled.
inline bool read_ac(BitReader& reader, const AcTable& table, const uint16_t* quant, int16_t* block, unsigned* last) {
  unsigned k = 1;
  *last = 0;
  while (k < 64) {
    const AcSymbol symbol = find_ac(reader, table);
    k += symbol.steps;
    if (k > 64) {
      reader.skip(symbol.code_bits);
      return symbol.steps == AcTable::kEnd;
    }
    const int32_t value = signed_value(reader.buffer() << symbol.code_bits, symbol.size);
    block[kNaturalOrder[k - 1]] = static_cast<int16_t>(value * quant[k - 1]);
    *last = k - 1;
    reader.skip(symbol.code_bits + symbol.size);
    reader.refill();
  }
  return true;
}

}  // namespace lf::jpeg
