// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "base/memory.h"
#include "wire/answer_codec.h"
#include "wire/fragment_codec.h"
#include "wire/unit.h"

namespace lf::rtp {

inline constexpr uint32_t kClockRate = 90000;
inline constexpr uint8_t kPayloadVersion = 1;

enum class PacketKind : uint8_t {
  kUnits = 0,  // whole units of the wire format in sequence
  kChunk = 1,  // a part of a unit that does not fit in a packet
};

inline constexpr size_t kUnitsHeaderBytes = 2, kChunkHeaderBytes = 12;

// Minimum payload size: room for a part of an answer with a few pixels.
inline constexpr size_t kMinPayloadBytes = 256;

struct Chunk {
  uint16_t unit = 0;    // number of the unit, incremented for each unit sent in chunks; wraps
  uint32_t offset = 0;  // in the unit, bytes
  uint32_t size = 0;    // of the whole unit, bytes
  std::span<const uint8_t> bytes;
};

void put_units_header(uint8_t* to);
void put_chunk_header(uint8_t* to, const Chunk& chunk);

// A parsed payload, units or a chunk, as views into the packet. Units are not checked, but there is at least one byte.
struct ParsedPayload {
  std::span<const uint8_t> units;
  std::optional<Chunk> chunk;
};
// Returns nullopt for truncated payloads, other versions, unknown kinds, and chunks that exceed their unit.
std::optional<ParsedPayload> parse_payload(std::span<const uint8_t> payload);

// Maps keys to values and keeps only the most recently used, so that state per view and source stays bounded. Values do
// not move in memory. Not thread-safe.
template <typename Value>
class LruMap {
 public:
  explicit LruMap(size_t most) : most_(most) {}

  // Returns the value of a key; a new key replaces the least recently used. Valid until the next call.
  Value& operator[](uint32_t key) {
    auto found = std::ranges::find(entries_, key, &Entry::first);
    if (found == entries_.end()) {
      if (entries_.size() == most_) entries_.erase(entries_.begin());
      entries_.emplace_back(key, std::make_unique<Value>());
    } else {
      std::rotate(found, found + 1, entries_.end());
    }
    return *entries_.back().second;
  }
  void clear() { entries_.clear(); }
  size_t size() const { return entries_.size(); }

 private:
  using Entry = std::pair<uint32_t, std::unique_ptr<Value>>;
  size_t most_;
  std::vector<Entry> entries_;  // most recently used at the end
};

// Splits an answer into parts, separate units of limited size. Pure functions.

// The smallest unit of splitting: a fragment, or a tile of a raw fragment.
struct Piece {
  size_t fragment = 0;
  std::optional<Rect> tile;
  size_t bytes = 0;  // payload only
};

struct Part {
  size_t first = 0, count = 0;  // pieces; each becomes a fragment
  size_t bytes = 0;             // of the unit
};

struct PartPlan {
  std::vector<Piece> pieces;
  std::vector<Part> parts;  // a part with a single piece may exceed `max_bytes`
  uint32_t total = 0;       // number of fragments in the whole answer, including tiles
};

// Assigns pieces to parts in table order, as many as fit. Raw fragments that do not fit are cut into tiles if the whole
// answer is available, because each part states the total number of fragments. Returns nullopt if the header alone
// takes up most of a part.
std::optional<PartPlan> plan_parts(const wire::AnswerView& answer, size_t max_bytes);

ByteBuffer write_part(const wire::AnswerView& answer, const PartPlan& plan, const Part& part, ByteBuffer memory);

// The data after an RTP header, as views into the packetizer and the unit.
struct Payload {
  std::array<uint8_t, kChunkHeaderBytes> header;
  size_t header_bytes = 0;
  std::vector<std::span<const uint8_t>> bytes;
  bool last = false;  // last packet of an answer or a request: sets the marker bit

  size_t size() const;
  void copy_to(uint8_t* to) const;
};

// Splits units of one kind into packets; see spec.md. Stores the latest requests of each view. Not thread-safe.
class Packetizer {
 public:
  explicit Packetizer(wire::UnitKind kind) : kind_(kind) {}

  wire::UnitKind kind() const { return kind_; }

  // Calls `emit` for each packet, in order. No payload exceeds `max_payload` (at least kMinPayloadBytes). Units of
  // unknown version or type are sent unchanged. Returns false unless `unit` is exactly one valid unit of this kind;
  // `reason` (may be null) then receives the reason.
  using Emit = std::function<void(const Payload&)>;
  bool packetize(std::span<const uint8_t> unit, size_t max_payload, const Emit& emit, std::string* reason = nullptr);

  void clear() { requests_.clear(); }

  struct Stats {
    uint64_t units = 0;
    uint64_t parts = 0;   // units sent in a single packet, whole or as parts of answers
    uint64_t chunks = 0;  // packets with a part of a unit
    uint64_t tiles = 0;
  };
  const Stats& stats() const { return stats_; }

 private:
  using Bytes = std::span<const uint8_t>;
  void send(Bytes unit, size_t max_payload, bool last, const Emit& emit);
  void send_request(Bytes unit, uint32_t view_id, size_t max_payload, const Emit& emit);
  void send_answer(Bytes unit, const wire::AnswerView& answer, size_t max_payload, const Emit& emit);

  // Number of earlier requests to repeat with each request, and maximum number of views.
  static constexpr size_t kRepeatedRequests = 2, kViews = 64;

  wire::UnitKind kind_;
  LruMap<std::vector<std::vector<uint8_t>>> requests_{kViews};
  ByteBuffer part_;
  uint16_t next_unit_ = 0;
  Stats stats_;
};

// Spreads a burst of packets to a given rate. Times in nanoseconds on any clock. Idle time is not made up later.
// Packets may leave up to kMaxLead early, because such a short wait is not worthwhile. Not thread-safe.
class Pacer {
 public:
  // Returns the departure time of the next packet, not before `now`. If the last departure is far in the future, the
  // clock was changed or set back, and the packet does not wait.
  uint64_t next(uint64_t now) {
    if (next_ && *next_ > now + duration_ + 2 * kMaxLead) next_.reset();
    return std::max(now + kMaxLead, next_.value_or(now)) - kMaxLead;
  }
  // Records that `bytes` leave at `time`, the last result of next(). `bits_per_second` must not be 0.
  void sent(uint64_t time, uint64_t bytes, uint64_t bits_per_second) {
    duration_ = static_cast<uint64_t>(8e9 * static_cast<double>(bytes) / static_cast<double>(bits_per_second));
    next_ = std::max(time, next_.value_or(time)) + duration_;
  }
  void clear() { next_.reset(); }

  static constexpr uint64_t kMaxLead = 250'000;  // nanoseconds: 31 KB at a gigabit per second

 private:
  std::optional<uint64_t> next_;
  uint64_t duration_ = 0;  // transmission time of the last packets at the given rate
};

}  // namespace lf::rtp
