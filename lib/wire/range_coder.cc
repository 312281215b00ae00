// SPDX-License-Identifier: LGPL-2.1-or-later
#include "wire/range_coder.h"

#include <utility>

namespace lf::wire {
namespace {

constexpr uint32_t kLeastRange = 1u << 24;
constexpr int kBytes = 4;  // of the range

}  // namespace

bool RangeEncoder::code(AdaptiveBit& decision, bool bit) {
  const uint32_t bound = (range_ >> AdaptiveBit::kPrecision) * decision.of_false();
  if (bit) low_ += bound;
  range_ = bit ? range_ - bound : bound;
  decision.learn(bit);
  for (; range_ < kLeastRange; range_ <<= 8) shift();
  return bit;
}

void RangeEncoder::shift() {
  const uint64_t carry = low_ >> 32;
  if (carry || low_ < 0xff000000) {
    // The first byte is always 0.
    if (std::exchange(started_, true)) bytes_.push_back(static_cast<uint8_t>(last_ + carry));
    for (; pending_; pending_--) bytes_.push_back(static_cast<uint8_t>(0xff + carry));
    last_ = static_cast<uint8_t>(low_ >> 24);
  } else {
    pending_++;
  }
  low_ = (low_ & 0x00ffffff) << 8;
}

std::vector<uint8_t> RangeEncoder::finish() {
  for (int i = 0; i <= kBytes; i++) shift();
  return std::move(bytes_);
}

RangeDecoder::RangeDecoder(std::span<const uint8_t> bytes) : bytes_(bytes) {
  for (int i = 0; i < kBytes; i++) shift();
}

void RangeDecoder::shift() {
  code_ = code_ << 8 | (read_ < bytes_.size() ? bytes_[read_] : 0);
  read_++;
}

bool RangeDecoder::code(AdaptiveBit& decision, bool) {
  const uint32_t bound = (range_ >> AdaptiveBit::kPrecision) * decision.of_false();
  const bool bit = code_ >= bound;
  if (bit) code_ -= bound;
  range_ = bit ? range_ - bound : bound;
  decision.learn(bit);
  for (; range_ < kLeastRange; range_ <<= 8) shift();
  return bit;
}

}  // namespace lf::wire
