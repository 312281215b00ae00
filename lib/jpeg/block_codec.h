// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstdint>

#include "jpeg/bit_reader.h"
#include "jpeg/huffman_table.h"
#include "jpeg/idct.h"

// These read one 8x8 block of a baseline scan (T.81 annex F), or pass over it, which takes no more than the lengths of
// its codes. Inline: BitReader has to stay in registers.
namespace lf::jpeg {

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

// One AC symbol, with the fields of an entry of AcTable.
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
    // jump that depends on the data. Two lookups of at most 26 bits lie between refills.
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
    // Reads one symbol by itself: a long code, or the chain goes on in the next block.
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

// Reads the AC coefficients of a block times `quant` (zigzag order) into `block` (each at its kIdctPlace), which has to
// be zero. False if they are damaged. *last: the index of the last one in zigzag order, 0 without any. Takes a reader
// just refilled, leaves it to be refilled.
inline bool read_ac(BitReader& reader, const AcTable& table, const uint16_t* quant, int16_t* block, unsigned* last) {
  const auto store = [&](unsigned k, int32_t value) { block[kIdctPlace[k]] = static_cast<int16_t>(value * quant[k]); };
  for (unsigned k = 1;;) {
    // Most symbols have short codes and small values: five of them fit between refills.
    uint32_t entry = 0;
    unsigned to = 0;
    for (int i = 0; i < 5; i++) {
      entry = table.shorts[reader.peek(AcTable::kShortBits)];
      to = k + AcTable::short_steps(entry);
      if (to >= 64) break;
      store(to - 1, AcTable::short_value(entry));
      reader.skip(AcTable::short_bits(entry));
      k = to;
    }
    if (to >= AcTable::kEnd || to == 64) {
      if (to == 64) store(63, AcTable::short_value(entry));
      reader.skip(AcTable::short_bits(entry));
      *last = to == 64 ? 63 : k - 1;
      return true;
    }
    reader.refill();
    if (to < 64) continue;
    const AcSymbol symbol = find_ac(reader, table);
    if (symbol.steps == AcTable::kEnd || k + symbol.steps > 64) {
      reader.skip(symbol.code_bits);
      *last = k - 1;
      return symbol.steps == AcTable::kEnd;
    }
    k += symbol.steps;
    store(k - 1, signed_value(reader.buffer() << symbol.code_bits, symbol.size));
    reader.skip(symbol.code_bits + symbol.size);
    if (k == 64) {
      *last = 63;
      return true;
    }
    reader.refill();
  }
}

}  // namespace lf::jpeg
