// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <array>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "base/memory.h"
#include "jpeg/header.h"
#include "jpeg/idct.h"

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

// These read one 8x8 block of a baseline scan (T.81 annex F), or pass over it, which takes no more than the lengths of
// its codes. Inline: BitReader has to stay in registers.

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

// The entropy-coded bytes of a scan, divided at its restart markers, and without the zeros that are stuffed in after FF
// where they are needed: a reader may then load eight bytes at a time. Not thread-safe.
class ScanData {
 public:
  // More than the longest MCU has bytes: 10 blocks of 64 coefficients with codes of 16 bits and 15 bits of value.
  static constexpr size_t kPadding = 2560;

  // `scan` begins with the first entropy-coded byte and ends anywhere after the last; any marker but a restart marker
  // ends the scan. It has to outlive this object. At most max_segments (> 0) are looked for: restart markers beyond are
  // taken for the end. Where a restart marker's number says that one or two segments are missing, these and the one
  // before it are entered empty; with any other wrong number the scan ends.
  ScanData(std::span<const uint8_t> scan, size_t max_segments);

  // The number of segments up to where the scan ends, at least one.
  size_t segments() const { return segments_.size(); }
  // Offsets in bytes() of a segment; empty if there is none of that index.
  struct Range {
    size_t begin = 0, end = 0;
  };
  Range segment(size_t index);
  // kPadding bytes can be read after any segment, whatever they are.
  const uint8_t* bytes() const { return bytes_.get(); }

 private:
  struct Segment {
    size_t begin = 0, end = 0;  // range of the stuffed bytes
    size_t clean_end = 0;       // where the clean bytes end, from `begin` in bytes_, once they are there
  };
  std::span<const uint8_t> scan_;
  std::vector<Segment> segments_;
  PooledBuffer bytes_;
};

// The MCUs of a baseline scan, from left to right and from top to bottom, in any order that its reader likes: restart
// markers let it jump, between them it passes over what it is not asked for, once. Not thread-safe.
class McuStream {
 public:
  static constexpr int kMaxBlocks = 10;
  // The dequantised coefficients of one MCU as idct() takes them, block after block in the scan's order.
  struct Mcu {
    alignas(64) int16_t block[kMaxBlocks][64];
    unsigned last[kMaxBlocks];  // no coefficient beyond this one, in zigzag order, is other than zero
  };

  // `header`: one_baseline_scan. `frame`, the bytes it was read from, has to outlive the stream. Check error() before
  // use.
  McuStream(const Header& header, std::span<const uint8_t> frame);
  McuStream(const McuStream&) = delete;
  McuStream& operator=(const McuStream&) = delete;

  // Nullptr, or why nothing can be read.
  const char* error() const { return error_; }

  // Goes to MCU x of row y. False if what lies before it is damaged.
  bool seek(int x, int y);
  // Reads or passes over the next MCU, or `count` MCUs, within the row of the last seek(). False if they are damaged.
  bool read(Mcu& mcu);
  bool pass(int count);

 private:
  struct Block {
    int component;
    const uint16_t* quant;
    const DcTable* dc;
    const AcTable* ac;
  };
  // The place in the data where an MCU begins.
  struct Position {
    int64_t mcu = -1;  // -1: not known
    uint64_t bit = 0;
    int32_t predictor[3] = {};
  };

  Position start_of_segment(int64_t segment);
  Position nearest_before(int64_t mcu);
  bool start_next();
  bool pass_to(int64_t mcu);
  bool move_to(const Position& next);

  const char* error_ = nullptr;
  int mcus_x_ = 0, mcus_y_ = 0;
  int64_t segment_mcus_ = 0;  // MCUs between restart markers
  uint16_t quant_[4][64];
  std::vector<Block> blocks_;
  std::vector<std::shared_ptr<const void>> tables_;
  std::optional<ScanData> data_;
  std::vector<Position> rows_;  // where rows of MCUs begin, as far as it is known
  Position at_;                 // position of the next MCU; where a segment has ended, at its end
  int64_t run_end_ = -1;        // MCUs up to this one lie in the same row and segment as at_, whose
  uint64_t end_of_data_ = 0;    // bits end here; both not known if run_end_ <= at_.mcu
};

}  // namespace lf::jpeg
