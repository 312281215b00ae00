// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstdint>
#include <map>
#include <vector>

#include "base/byte_buffer.h"
#include "rtp/payload_format.h"

namespace lf::rtp {

// Units in the making: puts chunks together again, in whatever order they come. Memory grows with the bytes that have
// come, never with what a header promises, and is bounded: the oldest units go first. Not thread-safe.
class Reassembly {
 public:
  struct Limits {
    size_t bytes = size_t{64} << 20;  // most bytes of all units in the making together, and of one
    size_t units = 64;
  };
  explicit Reassembly(const Limits& limits) : limits_(limits) {}

  enum class Result {
    kKept,
    kComplete,   // `unit` is there
    kDuplicate,  // exactly this chunk has come before
    kBad,        // the chunk contradicts what has come: another size of the unit, or an overlap
    kTooLarge,   // the unit is beyond the limit
  };
  Result add(uint32_t source, const Chunk& chunk, ByteBuffer& unit);

  void set_limits(const Limits& limits) { limits_ = limits; }
  // Throws all units in the making away; they count as dropped.
  void clear();
  // Units that had to make room for others.
  uint64_t dropped() const { return dropped_; }
  size_t bytes() const { return bytes_; }
  size_t units() const { return making_.size(); }

  // What a chunk costs beyond its bytes.
  static constexpr size_t kChunkCost = 96;

 private:
  struct Place {
    size_t size, at;  // bytes of the chunk, and where they are in Making::bytes
  };
  struct Making {
    uint32_t source;
    uint16_t number;
    uint32_t size;
    bool in_order = true;                // bytes are the unit's beginning
    ByteBuffer bytes;                    // bytes of the chunks, in the order in which they came
    std::map<uint32_t, Place> chunks{};  // places by offset in the unit
    size_t cost() const { return bytes.size() + chunks.size() * kChunkCost; }
  };
  void drop_oldest();
  static ByteBuffer finish(Making& making);

  Limits limits_;
  std::vector<Making> making_;  // the oldest first
  size_t bytes_ = 0;            // bytes that all units in the making take
  uint64_t dropped_ = 0;
};

}  // namespace lf::rtp
