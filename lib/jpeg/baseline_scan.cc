// SPDX-License-Identifier: LGPL-2.1-or-later
#include "jpeg/baseline_scan.h"

#include <algorithm>
#include <cstring>
#include <mutex>
#include <string_view>
#include <vector>

namespace lf::jpeg {
namespace {

// As in libjpeg, no code consists of ones only.
bool is_prefix_code(const HuffmanSpec& spec) {
  uint32_t code = 0;
  for (int i = 0; i < 16; i++) {
    code = 2 * code + spec.counts[i];
    if (code >= 2u << i) return false;
  }
  return code > 0;
}

// libjpeg refuses DC symbols above 15, even if unused.
bool has_symbols(const HuffmanSpec& spec, const DcTable*) {
  return std::all_of(spec.symbols.begin(), spec.symbols.end(), [](uint8_t symbol) { return symbol <= 15; });
}
bool has_symbols(const HuffmanSpec&, const AcTable*) { return true; }

// Calls set(first, last, code_bits, symbol) for each code, with the range of `bits`-bit numbers that begin with the
// code.
template <typename Set>
void for_each_code(const HuffmanSpec& spec, int bits, Set set) {
  uint32_t code = 0, index = 0;
  for (int length = 1; length <= bits; length++, code <<= 1)
    for (int i = 0; i < spec.counts[length - 1]; i++, code++)
      set(code << (bits - length), (code + 1) << (bits - length), length, spec.symbols[index++]);
}

std::shared_ptr<const DcTable> make(const HuffmanSpec& spec, const DcTable*) {
  auto table = std::make_shared<DcTable>(DcTable{LongCodes(spec), {}});
  for_each_code(spec, DcTable::kBits, [&](uint32_t first, uint32_t last, uint32_t length, uint32_t size) {
    if (size > 11) return;  // impossible for 8-bit samples
    std::fill(&table->entries[first], &table->entries[0] + last, (length + size) | length << 8 | size << 16);
  });
  return table;
}

std::shared_ptr<const AcTable> make(const HuffmanSpec& spec, const AcTable*) {
  struct Single {
    uint8_t code_bits = 0, size = 0, steps = AcTable::kNone;
  };
  std::array<Single, 1 << AcTable::kBits> singles{};
  for_each_code(spec, AcTable::kBits, [&](uint32_t first, uint32_t last, uint32_t length, uint32_t symbol) {
    const uint32_t run = symbol >> 4, size = symbol & 15;
    if (size == 0 && run != 0 && run != 15) return;  // invalid in baseline scans
    const auto steps = static_cast<uint8_t>(symbol == 0 ? AcTable::kEnd : run + 1);
    std::fill(&singles[first], &singles[0] + last,
              Single{static_cast<uint8_t>(length), static_cast<uint8_t>(size), steps});
  });

  auto table = std::make_shared<AcTable>(AcTable{LongCodes(spec), {}, {}});
  for (uint32_t i = 0; i < singles.size(); i++) {
    const Single& first = singles[i];
    uint32_t bits = 0, steps = 0;
    while (bits < AcTable::kBits) {
      const Single& next = singles[i << bits & (singles.size() - 1)];
      // Stop at codes that reach beyond the known bits, because they might match the zeros that were shifted in by
      // accident.
      if (next.code_bits == 0 || bits + next.code_bits > AcTable::kBits) break;
      if (next.steps != AcTable::kEnd && steps + next.steps > 63) break;
      bits += next.code_bits + next.size;
      steps += next.steps;
      if (next.steps == AcTable::kEnd) break;
    }
    if (bits == 0) steps = AcTable::kNone;
    table->entries[i] = bits | steps << 8 | static_cast<uint32_t>(first.code_bits) << 16 |
                        static_cast<uint32_t>(first.size) << 20 | static_cast<uint32_t>(first.steps) << 24;
  }
  for (uint32_t i = 0; i < table->shorts.size(); i++) {
    const Single& single = singles[i << (AcTable::kBits - AcTable::kShortBits)];
    const uint32_t bits = single.code_bits + single.size;
    table->shorts[i] = AcTable::kNone << 8;
    if (single.code_bits == 0 || bits > AcTable::kShortBits) continue;
    const int32_t value = signed_value(uint64_t{i} << (64 - AcTable::kShortBits) << single.code_bits, single.size);
    table->shorts[i] = bits | static_cast<uint32_t>(single.steps) << 8 | static_cast<uint32_t>(value) << 16;
  }
  return table;
}

// A least recently used cache of tables.
template <typename Table>
class Cache {
 public:
  std::shared_ptr<const Table> get(const HuffmanSpec& spec) {
    static_assert(sizeof spec == 16 + 256);
    const size_t hash = std::hash<std::string_view>()({reinterpret_cast<const char*>(&spec), sizeof spec});
    const std::lock_guard lock(mutex_);
    const auto found = std::find_if(entries_.begin(), entries_.end(),
                                    [&](const Entry& e) { return e.hash == hash && e.spec == spec; });
    now_++;
    if (found != entries_.end()) {
      found->used = now_;
      return found->table;
    }
    if (!is_prefix_code(spec) || !has_symbols(spec, static_cast<const Table*>(nullptr))) return nullptr;
    if (entries_.size() == kEntries)
      entries_.erase(std::min_element(entries_.begin(), entries_.end(),
                                      [](const Entry& a, const Entry& b) { return a.used < b.used; }));
    entries_.push_back({hash, now_, spec, make(spec, static_cast<const Table*>(nullptr))});
    return entries_.back().table;
  }

 private:
  static constexpr size_t kEntries = 128;  // 2 MiB of AC tables: one set for each of 64 cameras with adaptive tables
  struct Entry {
    size_t hash;
    uint64_t used;
    HuffmanSpec spec;
    std::shared_ptr<const Table> table;
  };
  std::mutex mutex_;
  std::vector<Entry> entries_;
  uint64_t now_ = 0;
};

}  // namespace

LongCodes::LongCodes(const HuffmanSpec& spec) : symbols_(spec.symbols) {
  uint32_t code = 0, index = 0;
  for (int i = 0; i < 16; i++, code <<= 1) {
    offset_[i] = static_cast<int32_t>(index) - static_cast<int32_t>(code);
    index += spec.counts[i];
    code += spec.counts[i];
    end_[i] = code << (15 - i);
  }
}

HuffmanSymbol LongCodes::find(uint32_t next16) const {
  for (int i = 0; i < 16; i++)
    if (next16 < end_[i])
      return {static_cast<uint8_t>(i + 1),
              symbols_[static_cast<size_t>(static_cast<int32_t>(next16 >> (15 - i)) + offset_[i]) & 255]};
  return {};
}

std::shared_ptr<const DcTable> dc_table(const HuffmanSpec& spec) {
  static Cache<DcTable>* const cache = new Cache<DcTable>;
  return cache->get(spec);
}

std::shared_ptr<const AcTable> ac_table(const HuffmanSpec& spec) {
  static Cache<AcTable>* const cache = new Cache<AcTable>;
  return cache->get(spec);
}

namespace {

const uint8_t* find_ff(const uint8_t* begin, const uint8_t* end) {
  if (begin == end) return end;  // may be null
  const void* const found = std::memchr(begin, 0xff, static_cast<size_t>(end - begin));
  return found ? static_cast<const uint8_t*>(found) : end;
}

}  // namespace

ScanData::ScanData(std::span<const uint8_t> scan, size_t max_segments) : scan_(scan) {
  bytes_ = take_buffer(scan.size() + kPadding);
  const uint8_t* const first = scan.data();
  const uint8_t* const end = first + scan.size();
  const auto offset = [&](const uint8_t* at) { return static_cast<size_t>(at - first); };
  size_t begin = 0;
  const uint8_t* ff = find_ff(first, end);
  while (ff != end) {
    const uint8_t* next = ff + 1;
    if (next != end && *next == 0) {
      ff = find_ff(next + 1, end);
      continue;
    }
    while (next != end && *next == 0xff) next++;
    if (next == end || *next < 0xd0 || *next > 0xd7) break;
    // As in libjpeg, assume that up to two segments may be lost, and that a larger gap means a damaged marker. It is
    // then unknown which segment the bytes before the marker belong to.
    const size_t missing = (*next - 0xd0 - segments_.size()) & 7;
    if (missing > 2 || segments_.size() + 1 + missing >= max_segments) break;
    segments_.push_back({begin, missing > 0 ? begin : offset(ff)});
    begin = offset(next) + 1;
    segments_.insert(segments_.end(), missing, {begin, begin});
    ff = find_ff(next + 1, end);
  }
  segments_.push_back({begin, offset(ff)});
}

ScanData::Range ScanData::segment(size_t index) {
  if (index >= segments_.size()) return {};
  Segment& s = segments_[index];
  if (s.clean_end == 0 && s.begin != s.end) {
    uint8_t* out = bytes_.get() + s.begin;
    const uint8_t* in = scan_.data() + s.begin;
    const uint8_t* const end = scan_.data() + s.end;
    while (in != end) {
      const uint8_t* const ff = find_ff(in, end);
      const size_t size = static_cast<size_t>(ff - in) + (ff != end);
      std::memcpy(out, in, size);
      out += size;
      in = ff == end ? end : ff + 2;
    }
    // A reader may load bits after the last bit. At least two bytes of a marker separate segments.
    out[0] = out[1] = 0;
    s.clean_end = static_cast<size_t>(out - bytes_.get());
  }
  return {s.begin, s.clean_end};
}

namespace {

// DC coefficients of 8-bit samples have 11 bits and a sign, even if an encoder rounds carelessly. Larger values mean
// damage. The limit also prevents overflow of the predictors.
bool plausible(const int32_t (&predictor)[3]) {
  return std::all_of(predictor, predictor + 3, [](int32_t dc) { return dc >= -2048 && dc <= 2048; });
}

}  // namespace

McuStream::McuStream(const Header& header, std::span<const uint8_t> frame)
    : mcus_x_(header.mcus_x()), mcus_y_(header.mcus_y()) {
  std::memcpy(quant_, header.quant, sizeof quant_);
  for (int i = 0; i < header.components; i++) {
    const Component& c = header.component[i];
    const auto dc = dc_table(header.dc[c.dc]);
    const auto ac = ac_table(header.ac[c.ac]);
    if (!dc || !ac) {
      error_ = "a Huffman table is missing or damaged";
      return;
    }
    blocks_.insert(blocks_.end(), static_cast<size_t>(c.h * c.v), {i, quant_[c.quant], dc.get(), ac.get()});
    tables_.insert(tables_.end(), {dc, ac});
  }
  const int64_t mcus = int64_t{mcus_x_} * mcus_y_;
  segment_mcus_ = header.restart_interval > 0 ? header.restart_interval : mcus;
  data_.emplace(frame.subspan(header.scan), static_cast<size_t>((mcus + segment_mcus_ - 1) / segment_mcus_));
  rows_.resize(static_cast<size_t>(mcus_y_));
}

McuStream::Position McuStream::start_of_segment(int64_t segment) {
  Position start;
  start.mcu = segment * segment_mcus_;
  start.bit = uint64_t{data_->segment(static_cast<size_t>(segment)).begin} * 8;
  return start;
}

McuStream::Position McuStream::nearest_before(int64_t mcu) {
  Position best = start_of_segment(mcu / segment_mcus_);
  for (int64_t row = mcu / mcus_x_; row * mcus_x_ > best.mcu; row--)
    if (const Position& start = rows_[static_cast<size_t>(row)]; start.mcu >= 0) {
      best = start;
      break;
    }
  return at_.mcu > best.mcu && at_.mcu <= mcu ? at_ : best;
}

bool McuStream::seek(int x, int y) {
  const int64_t mcu = int64_t{y} * mcus_x_ + x;
  at_ = nearest_before(mcu);
  run_end_ = -1;
  return skip_to(mcu);
}

bool McuStream::pass(int count) { return skip_to(at_.mcu + count); }

// Prepares for reading an MCU: enters the next segment if necessary, and records the start of rows.
bool McuStream::start_next() {
  if (at_.mcu >= run_end_) {
    const int64_t segment = at_.mcu / segment_mcus_, row = at_.mcu / mcus_x_;
    if (at_.mcu == segment * segment_mcus_) at_ = start_of_segment(segment);
    if (at_.mcu == row * mcus_x_) rows_[static_cast<size_t>(row)] = at_;
    run_end_ = std::min((segment + 1) * segment_mcus_, (row + 1) * mcus_x_);
    end_of_data_ = uint64_t{data_->segment(static_cast<size_t>(segment)).end} * 8;
  }
  return at_.bit < end_of_data_;
}

// Whole bytes that are left before a restart marker indicate damage, just like missing bits. The last MCU is an
// exception, because some cameras send padding there.
bool McuStream::move_to(const Position& next) {
  if (next.bit > end_of_data_) return false;
  if (next.mcu == run_end_ && next.mcu % segment_mcus_ == 0 && next.mcu < int64_t{mcus_x_} * mcus_y_ &&
      end_of_data_ - next.bit >= 8)
    return false;
  at_ = next;
  return true;
}

bool McuStream::skip_to(int64_t mcu) {
  while (at_.mcu < mcu) {
    if (!start_next()) return false;
    const int64_t stop = std::min(mcu, run_end_);
    BitReader reader(data_->bytes(), at_.bit);
    int32_t predictor[3] = {at_.predictor[0], at_.predictor[1], at_.predictor[2]};
    for (int64_t i = at_.mcu; i < stop; i++) {
      for (const Block& block : blocks_) {
        reader.refill();
        if (!read_dc(reader, *block.dc, predictor[block.component]) || !skip_ac(reader, *block.ac)) return false;
      }
      if (reader.position() > end_of_data_ || !plausible(predictor)) return false;
    }
    if (!move_to({stop, reader.position(), {predictor[0], predictor[1], predictor[2]}})) return false;
  }
  return true;
}

bool McuStream::read(Mcu& mcu) {
  if (!start_next()) return false;
  BitReader reader(data_->bytes(), at_.bit);
  Position next = at_;
  std::memset(mcu.block, 0, sizeof mcu.block[0] * blocks_.size());
  for (size_t i = 0; i < blocks_.size(); i++) {
    const Block& block = blocks_[i];
    int32_t& predictor = next.predictor[block.component];
    reader.refill();
    if (!read_dc(reader, *block.dc, predictor)) return false;
    reader.refill();
    if (!read_ac(reader, *block.ac, block.quant, mcu.block[i], &mcu.last[i])) return false;
    mcu.block[i][0] = static_cast<int16_t>(predictor * block.quant[0]);
  }
  next.bit = reader.position();
  next.mcu++;
  return plausible(next.predictor) && move_to(next);
}

}  // namespace lf::jpeg
