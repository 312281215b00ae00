// SPDX-License-Identifier: LGPL-2.1-or-later
#include "jpeg/huffman_table.h"

#include <algorithm>
#include <mutex>
#include <string_view>
#include <vector>

namespace lf::jpeg {
namespace {

// As libjpeg has it: none of its codes is all ones.
bool is_prefix_code(const HuffmanSpec& spec) {
  uint32_t code = 0;
  for (int i = 0; i < 16; i++) {
    code = 2 * code + spec.counts[i];
    if (code >= 2u << i) return false;
  }
  return code > 0;
}

// Of differences of DC coefficients libjpeg wants no symbol beyond 15, used or not.
bool has_symbols(const HuffmanSpec& spec, const DcTable*) {
  return std::all_of(spec.symbols.begin(), spec.symbols.end(), [](uint8_t symbol) { return symbol <= 15; });
}
bool has_symbols(const HuffmanSpec&, const AcTable*) { return true; }

// Calls set(first, last, code_bits, symbol) with the range of numbers of `bits` bits that begin with each code.
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
    if (size > 11) return;  // no difference of 8-bit samples
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
    if (size == 0 && run != 0 && run != 15) return;  // no symbol of a baseline scan
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
      // Codes that reach beyond the known bits are not known, be it as it may that one fits the zeros shifted in.
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

// The latest used tables.
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
  static constexpr size_t kEntries = 128;  // 2 MiB of AC tables: a set each for 64 cameras that adapt theirs
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

}  // namespace lf::jpeg
