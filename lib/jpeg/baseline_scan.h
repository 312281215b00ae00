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

// Reads bits of unstuffed entropy-coded bytes, starting with the most significant bit. The reader does not check for
// the end of the data, so the caller must compare position() with the end. Eight bytes after any read position must be
// readable.
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
  // Returns the next `bits` bits, 1 to 32.
  uint32_t peek(int bits) const { return static_cast<uint32_t>(buffer_ >> (64 - bits)); }
  // Returns all available bits, left-aligned. Lower bits are undefined.
  uint64_t buffer() const { return buffer_; }
  // `bits` must be less than 64, and that many bits must be available.
  void skip(unsigned bits) {
    buffer_ <<= bits;
    available_ -= bits;
  }
  uint64_t position() const { return static_cast<uint64_t>(next_ - base_) * 8 - available_; }

 private:
  const uint8_t* base_;
  const uint8_t* next_;
  uint64_t buffer_ = 0;
  unsigned available_ = 0;
};

struct HuffmanSymbol {
  uint8_t code_bits = 0;  // 0 for an invalid code
  uint8_t symbol = 0;
};

// Finds codes of any length by comparison (T.81 annex F.2.2.3). It is used for codes that are too long for a lookup
// table.
class LongCodes {
 public:
  // `spec` must be a prefix code.
  explicit LongCodes(const HuffmanSpec& spec);
  HuffmanSymbol find(uint32_t next16) const;

 private:
  std::array<uint32_t, 16> end_;    // first 16-bit number beyond the codes of i + 1 bits
  std::array<int32_t, 16> offset_;  // symbol index minus code, for codes of i + 1 bits
  std::array<uint8_t, 256> symbols_;
};

// A lookup table for DC codes, indexed by the next kBits bits. Entries are packed fields. An entry of 0 means that the
// code is longer than kBits, or invalid.
struct DcTable {
  static constexpr int kBits = 9;
  static unsigned total_bits(uint32_t entry) { return entry & 0xff; }  // bits of the code and the difference
  static unsigned code_bits(uint32_t entry) { return entry >> 8 & 0xff; }
  static unsigned size(uint32_t entry) { return entry >> 16; }  // bits of the difference, 0 to 11

  LongCodes long_codes;
  std::array<uint32_t, 1 << kBits> entries;
};

// A lookup table for AC codes, indexed by the next kBits bits. An entry describes the first symbol, and the chain of
// all complete symbols in these bits, so that a block can be skipped with a few lookups.
struct AcTable {
  static constexpr int kBits = 11;
  // The chain: bits of its codes and values, and number of its coefficients (0 to 63). kEnd is added to the number if
  // the chain ends the block.
  static constexpr unsigned kEnd = 128;
  static constexpr unsigned kNone = 64;  // 64 steps and no bits: an invalid code, or a longer code
  static unsigned chain_bits(uint32_t entry) { return entry & 0xff; }
  static unsigned chain_steps(uint32_t entry) { return entry >> 8 & 0xff; }
  // The first symbol: number of its coefficients (1 to 16, the last one has the value), kEnd or kNone.
  static unsigned code_bits(uint32_t entry) { return entry >> 16 & 15; }
  static unsigned size(uint32_t entry) { return entry >> 20 & 15; }
  static unsigned steps(uint32_t entry) { return entry >> 24; }

  LongCodes long_codes;
  std::array<uint32_t, 1 << kBits> entries;

  // One symbol with its value if both fit in the next kShortBits bits, else kNone.
  static constexpr int kShortBits = 10;
  static unsigned short_bits(uint32_t entry) { return entry & 0xff; }
  static unsigned short_steps(uint32_t entry) { return entry >> 8 & 0xff; }
  static int32_t short_value(uint32_t entry) { return static_cast<int32_t>(entry) >> 16; }
  std::array<uint32_t, 1 << kShortBits> shorts;
};

// Returns the signed number of `size` bits (0 to 15) at the top of `bits`. In T.81's coding, a leading zero means a
// negative number.
inline int32_t signed_value(uint64_t bits, unsigned size) {
  const auto magnitude = static_cast<int32_t>(bits >> 1 >> (63 - size));
  const auto negative = static_cast<int32_t>(~(static_cast<int64_t>(bits) >> 63));
  return magnitude + (negative & (1 - (1 << size)));
}

// Return the table for a specification, or null if it is empty or not a prefix code. Tables are cached, because cameras
// send the same tables with every frame. Thread-safe.
std::shared_ptr<const DcTable> dc_table(const HuffmanSpec& spec);
std::shared_ptr<const AcTable> ac_table(const HuffmanSpec& spec);

// The functions below read or skip one 8x8 block of a baseline scan (T.81 annex F).

// Adds the block's difference to the predictor. Returns false if the code is invalid. Reads at most 27 bits.
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

// An AC symbol: the number of coefficients that it covers (or kEnd or kNone of AcTable), and the bits of its code and
// of its value.
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

// Skips the AC coefficients of a block. Returns false if the data is damaged. At most 27 bits may have been read since
// the last refill(). The caller must then call refill().
inline bool skip_ac(BitReader& reader, const AcTable& table) {
  for (unsigned k = 1;;) {
    // This loop ends at a chain that reaches the last coefficient, ends the block, or has no symbol. Its end is the
    // only jump that depends on the data. There are two lookups of at most 26 bits between refills.
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

// Reads the AC coefficients of a block, multiplies them by `quant` (in zigzag order), and writes them to `block` (in
// kIdctOrder), which must be zero. *last becomes the zigzag index of the last coefficient, or 0 if there is none.
// Returns false if the data is damaged. The caller must refill() before and after the call.
inline bool read_ac(BitReader& reader, const AcTable& table, const uint16_t* quant, int16_t* block, unsigned* last) {
  const auto store = [&](unsigned k, int32_t value) { block[kIdctOrder[k]] = static_cast<int16_t>(value * quant[k]); };
  for (unsigned k = 1;;) {
    // Most symbols have short codes and small values. Five such symbols fit between refills.
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

// The entropy-coded bytes of a scan, divided at restart markers. Stuffed zeros after FF are removed on demand, so that
// a reader can load eight bytes at a time. Not thread-safe.
class ScanData {
 public:
  // more than the longest MCU: 10 blocks of 64 coefficients, with 16-bit codes and 15-bit values
  static constexpr size_t kPadding = 2560;

  // `scan` begins with the first entropy-coded byte and must outlive this object. The scan ends after max_segments (>
  // 0) segments, or before, at any marker but a restart marker. The number of a restart marker may show that one or two
  // segments are missing; these segments and the previous one then become empty. Any other wrong number ends the scan.
  ScanData(std::span<const uint8_t> scan, size_t max_segments);

  // Returns the number of segments of the scan, at least 1.
  size_t segments() const { return segments_.size(); }
  // The range of a segment in bytes(). It is empty for an invalid index.
  struct Range {
    size_t begin = 0, end = 0;
  };
  Range segment(size_t index);
  // After each segment, kPadding bytes of any value are readable.
  const uint8_t* bytes() const { return bytes_.get(); }

 private:
  struct Segment {
    size_t begin = 0, end = 0;  // range in the stuffed bytes
    size_t clean_end = 0;       // end of the clean bytes in bytes_, which start at `begin`; 0 until they are needed
  };
  std::span<const uint8_t> scan_;
  std::vector<Segment> segments_;
  PooledBuffer bytes_;
};

// Reads the MCUs of a baseline scan in any order. The stream starts at a restart marker or at a known start of a row,
// and skips the MCUs from there. Not thread-safe.
class McuStream {
 public:
  static constexpr int kMaxBlocks = 10;
  // The dequantised coefficients of one MCU in the layout of idct(), with blocks in the order of the scan.
  struct Mcu {
    alignas(64) int16_t block[kMaxBlocks][64];
    unsigned last[kMaxBlocks];  // zigzag index of the last coefficient that may be nonzero
  };

  // `header` must have one_baseline_scan. `frame` contains the bytes of the header and must outlive the stream. Check
  // error() before use.
  McuStream(const Header& header, std::span<const uint8_t> frame);
  McuStream(const McuStream&) = delete;
  McuStream& operator=(const McuStream&) = delete;

  // Returns null, or the reason why nothing can be read.
  const char* error() const { return error_; }

  // Moves to MCU x of row y. Returns false if the data before it is damaged.
  bool seek(int x, int y);
  // Read the next MCU, or skip `count` MCUs, within the row of the last seek(). Return false if the data is damaged.
  bool read(Mcu& mcu);
  bool pass(int count);

 private:
  struct Block {
    int component;
    const uint16_t* quant;
    const DcTable* dc;
    const AcTable* ac;
  };
  struct Position {
    int64_t mcu = -1;  // -1: unknown
    uint64_t bit = 0;
    int32_t predictor[3] = {};
  };

  Position start_of_segment(int64_t segment);
  Position nearest_before(int64_t mcu);
  bool start_next();
  bool skip_to(int64_t mcu);
  bool move_to(const Position& next);

  const char* error_ = nullptr;
  int mcus_x_ = 0, mcus_y_ = 0;
  int64_t segment_mcus_ = 0;
  uint16_t quant_[4][64];
  std::vector<Block> blocks_;
  std::vector<std::shared_ptr<const void>> tables_;
  std::optional<ScanData> data_;
  std::vector<Position> rows_;  // start of each row of MCUs, if known
  Position at_;                 // the next MCU, or the end of a segment
  int64_t run_end_ = -1;        // MCUs before this one are in the same row and segment as at_
  uint64_t end_of_data_ = 0;    // end of that segment, bits; run_end_ <= at_.mcu means that both are unknown
};

}  // namespace lf::jpeg
