// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <algorithm>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

namespace lf::wire {

// The probability of a binary decision, learned from earlier decisions of the same kind: the first ones count most.
class AdaptiveBit {
 public:
  static constexpr int kPrecision = 12;  // bits
  // The probability that the decision is false, from 1 to 2^kPrecision - 1.
  uint32_t of_false() const { return of_false_; }
  void learn(bool bit) {
    const int shift = std::min(kSlowest, static_cast<int>(std::bit_width(seen_ + 2)) - 1);
    seen_ = std::min(seen_ + 1, kMostSeen);
    of_false_ = bit ? of_false_ - (of_false_ >> shift) : of_false_ + (((1u << kPrecision) - of_false_) >> shift);
  }

 private:
  static constexpr int kSlowest = 5;
  static constexpr uint32_t kMostSeen = 1u << kSlowest;
  uint32_t of_false_ = 1u << (kPrecision - 1);
  uint32_t seen_ = 0;
};

// The range coder of LZMA. The encoder and the decoder have the same interface, so that one function template can both
// encode and decode.
class RangeEncoder {
 public:
  bool code(AdaptiveBit& decision, bool bit);
  std::vector<uint8_t> finish();

 private:
  void shift();

  uint64_t low_ = 0;
  uint32_t range_ = UINT32_MAX;
  uint8_t last_ = 0;    // the last byte, which a carry can still change
  size_t pending_ = 0;  // bytes 0xff after it, which a carry would change, too
  bool started_ = false;
  std::vector<uint8_t> bytes_;
};

class RangeDecoder {
 public:
  explicit RangeDecoder(std::span<const uint8_t> bytes);
  // Returns the next decision; `ignored` exists only for the interface of the encoder.
  bool code(AdaptiveBit& decision, bool ignored);
  // Returns true if all bytes have been read, and no byte was missing.
  bool is_complete() const { return read_ == bytes_.size(); }

 private:
  void shift();

  std::span<const uint8_t> bytes_;
  size_t read_ = 0;
  uint32_t code_ = 0;
  uint32_t range_ = UINT32_MAX;
};

}  // namespace lf::wire
