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
  kUnits = 0,
  kChunk = 1,  // a chunk: a part of a unit that does not fit in a packet
};

inline constexpr size_t kUnitsHeaderBytes = 2, kChunkHeaderBytes = 12;

// Minimum payload size in bytes. It leaves room for a part of an answer with a few pixels.
inline constexpr size_t kMinPayloadBytes = 256;

struct Chunk {
  uint16_t unit = 0;    // counts the units that are sent in chunks; wraps around
  uint32_t offset = 0;  // position of the chunk in the unit, bytes
  uint32_t size = 0;    // size of the whole unit, bytes
  std::span<const uint8_t> bytes;
};

void put_units_header(uint8_t* to);
void put_chunk_header(uint8_t* to, const Chunk& chunk);

// The content of a packet, as views into the packet: either units, which are at least one byte and unchecked, or a
// chunk.
struct ParsedPayload {
  std::span<const uint8_t> units;
  std::optional<Chunk> chunk;
};
// Returns nullopt if the payload is truncated, has another version or an unknown kind, or contains a chunk that exceeds
// its unit.
std::optional<ParsedPayload> parse_payload(std::span<const uint8_t> payload);

// Maps keys to values and keeps only the `most` recently used keys, so that the state per view and source stays
// bounded. Values do not move in memory. Not thread-safe.
template <typename Value>
class LruMap {
 public:
  explicit LruMap(size_t most) : most_(most) {}

  // Returns the value of a key. If the map is full, a new key replaces the least recently used key. The reference is
  // valid until the next call.
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

// The following functions split a large answer into parts, which are valid units that fit in one packet. A lost packet
// then costs only some fragments and not the whole answer. The functions are pure.

// A piece of an answer: a whole fragment, or a tile (a rectangular part) of an uncompressed fragment that is too large
// for a packet.
struct Piece {
  size_t fragment = 0;
  std::optional<Rect> tile;
  size_t bytes = 0;  // of the payload
};

// The pieces that one part of the answer contains; a part is sent in one packet.
struct Part {
  size_t first = 0, count = 0;  // numbers of the pieces; each piece becomes a fragment
  size_t bytes = 0;
};

struct PartPlan {
  std::vector<Piece> pieces;
  std::vector<Part> parts;  // a part exceeds `max_bytes` if its only piece does
  uint32_t total = 0;       // fragments of the whole answer, after cutting into tiles
};

// Assigns pieces to parts in table order, as many as fit into each part. A raw fragment that is too large is cut into
// tiles, but only if the whole answer is available, because each part states the total number of fragments. Returns
// nullopt if the header alone takes up most of a part.
std::optional<PartPlan> plan_parts(const wire::AnswerView& answer, size_t max_bytes);

ByteBuffer write_part(const wire::AnswerView& answer, const PartPlan& plan, const Part& part, ByteBuffer memory);

// The bytes after the RTP header of a packet, as views into the packetizer and the unit.
struct Payload {
  std::array<uint8_t, kChunkHeaderBytes> header;
  size_t header_bytes = 0;
  std::vector<std::span<const uint8_t>> bytes;
  bool last = false;  // the packet is the last of an answer or a request and gets the marker bit

  size_t size() const;
  void copy_to(uint8_t* to) const;
};

// Splits units of one kind into packets; see spec.md. Keeps the latest requests of each view and repeats them with the
// next request, so that a single lost packet does not lose a request. Not thread-safe.
class Packetizer {
 public:
  explicit Packetizer(wire::UnitKind kind) : kind_(kind) {}

  wire::UnitKind kind() const { return kind_; }

  // Calls `emit` for each packet, in order. Each payload has at most `max_payload` bytes, which must be at least
  // kMinPayloadBytes. Units of an unknown version or type are sent unchanged. Returns false unless `unit` is exactly
  // one valid unit of this kind. `reason`, unless null, then receives an explanation.
  using Emit = std::function<void(const Payload&)>;
  bool packetize(std::span<const uint8_t> unit, size_t max_payload, const Emit& emit, std::string* reason = nullptr);

  void clear() { requests_.clear(); }

  struct Stats {
    uint64_t units = 0;
    uint64_t parts = 0;   // units and parts of answers that fit in one packet
    uint64_t chunks = 0;  // packets with a part of a larger unit
    uint64_t tiles = 0;
  };
  const Stats& stats() const { return stats_; }

 private:
  using Bytes = std::span<const uint8_t>;
  void send(Bytes unit, size_t max_payload, bool last, const Emit& emit);
  void send_request(Bytes unit, uint32_t view_id, size_t max_payload, const Emit& emit);
  void send_answer(Bytes unit, const wire::AnswerView& answer, size_t max_payload, const Emit& emit);

  // Each request repeats this many earlier requests; state is kept for this many views.
  static constexpr size_t kRepeatedRequests = 2, kViews = 64;

  wire::UnitKind kind_;
  LruMap<std::vector<std::vector<uint8_t>>> requests_{kViews};
  ByteBuffer part_;
  uint16_t next_unit_ = 0;
  Stats stats_;
};

// Spreads a burst of packets over time, so that they leave at a given bit rate and do not overflow the buffers of
// switches and receivers. All times are in nanoseconds of any clock. After idle time, packets do not leave faster than
// the bit rate. A packet may leave up to kMaxLead early, because such a short wait is not worthwhile. Not thread-safe.
class Pacer {
 public:
  // Returns the departure time of the next packet, which is at least `now`. If the last departure is far in the future,
  // the clock was set back, and the packet does not wait.
  uint64_t next(uint64_t now) {
    if (next_ && *next_ > now + duration_ + 2 * kMaxLead) next_.reset();
    return std::max(now + kMaxLead, next_.value_or(now)) - kMaxLead;
  }
  // Records that `bytes` bytes leave at `time`, the last result of next(). `bits_per_second` must not be 0.
  void sent(uint64_t time, uint64_t bytes, uint64_t bits_per_second) {
    duration_ = static_cast<uint64_t>(8e9 * static_cast<double>(bytes) / static_cast<double>(bits_per_second));
    next_ = std::max(time, next_.value_or(time)) + duration_;
  }
  void clear() { next_.reset(); }

  static constexpr uint64_t kMaxLead = 250'000;  // nanoseconds; a gigabit link sends 31 KB in this time

 private:
  std::optional<uint64_t> next_;
  uint64_t duration_ = 0;  // transmission time of the last packets, nanoseconds
};

}  // namespace lf::rtp
