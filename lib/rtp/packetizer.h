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

// What stands behind the RTP header of a packet; see spec.md.
namespace lf::rtp {

inline constexpr uint32_t kClockRate = 90000;
inline constexpr uint8_t kPayloadVersion = 1;

enum class PacketKind : uint8_t {
  kUnits = 0,  // whole units of the wire format, one after the other
  kChunk = 1,  // a piece of a unit that is larger than a packet
};

inline constexpr size_t kUnitsHeaderBytes = 2, kChunkHeaderBytes = 12;

// Payloads are never smaller than this: a part of an answer has to fit in one with a few pixels.
inline constexpr size_t kMinPayloadBytes = 256;

struct Chunk {
  uint16_t unit = 0;    // number of the unit: one more for each that is sent in chunks; wraps
  uint32_t offset = 0;  // where in the unit `bytes` begin
  uint32_t size = 0;    // bytes of the whole unit
  std::span<const uint8_t> bytes;
};

// These write the header in front of units or of a chunk's bytes.
void put_units_header(uint8_t* to);
void put_chunk_header(uint8_t* to, const Chunk& chunk);

// What a sound payload has, units or a chunk, where it lies; units are not looked at, but there is at least one byte.
struct ParsedPayload {
  std::span<const uint8_t> units;
  std::optional<Chunk> chunk;
};
// Nothing for payloads that are cut short, of another version or an unknown kind, and for chunks beyond their unit.
std::optional<ParsedPayload> parse_payload(std::span<const uint8_t> payload);

// Keeps a value for each of the keys used last: what is kept of views and sources stays bounded, whatever comes. Values
// stay where they are, however large: to use another key moves a few bytes for each. Not thread-safe.
template <typename Value>
class Recent {
 public:
  explicit Recent(size_t most) : most_(most) {}

  // The value of a key: a new one, in place of that used longest ago, if there is none. Valid until the next call.
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
  std::vector<Entry> entries_;  // the entry that was used last is at the end
};

// How an answer is divided into parts, each a unit of its own of at most so many bytes. Pure.

// What stays together: a fragment of the answer, or a tile of a raw one.
struct Piece {
  size_t fragment = 0;
  std::optional<Rect> tile;
  size_t bytes = 0;  // bytes of payload
};

struct Part {
  size_t first = 0, count = 0;  // pieces, each a fragment of its own
  size_t bytes = 0;             // bytes of the unit
};

struct PartPlan {
  std::vector<Piece> pieces;
  std::vector<Part> parts;  // a part of a single piece may have more than `max_bytes`
  uint32_t total = 0;       // fragments of the whole answer, tiles counted
};

// Plans the parts: in the table's order, as many pieces in a part as have room. Raw fragments that have none are cut
// into tiles where all the answer is at hand: the number of its fragments is told in each part. Nothing if dividing is
// of no use, because the header alone takes up most of a part.
std::optional<PartPlan> plan_parts(const wire::AnswerView& answer, size_t max_bytes);

// The unit of one part, made in `memory`.
ByteBuffer write_part(const wire::AnswerView& answer, const PartPlan& plan, const Part& part, ByteBuffer memory);

// What goes behind one RTP header, in pieces that refer to memory of the packetizer and of the unit.
struct Payload {
  std::array<uint8_t, kChunkHeaderBytes> header;
  size_t header_bytes = 0;
  std::vector<std::span<const uint8_t>> bytes;
  bool last = false;  // the last packet of an answer or a request: has the marker

  size_t size() const;
  void copy_to(uint8_t* to) const;  // size() bytes
};

// Cuts units of one kind into packets; see spec.md. Keeps the latest requests of each view and memory from call to
// call; not thread-safe.
class Packetizer {
 public:
  explicit Packetizer(wire::UnitKind kind) : kind_(kind) {}

  wire::UnitKind kind() const { return kind_; }

  // Calls `emit` for each packet, in order; none of them is larger than `max_payload` (at least kMinPayloadBytes).
  // Units of a version or type not known are sent as they are. False for bytes that are not exactly one sound unit of
  // this kind; `reason` (may be null) then says why.
  using Emit = std::function<void(const Payload&)>;
  bool packetize(std::span<const uint8_t> unit, size_t max_payload, const Emit& emit, std::string* reason = nullptr);

  // Forgets the requests.
  void clear() { requests_.clear(); }

  struct Stats {
    uint64_t units = 0;   // units taken
    uint64_t parts = 0;   // units sent in a packet of their own, whole or parts of answers
    uint64_t chunks = 0;  // packets with a piece of a unit
    uint64_t tiles = 0;   // pieces that raw fragments were cut into
  };
  const Stats& stats() const { return stats_; }

 private:
  using Bytes = std::span<const uint8_t>;
  void send(Bytes unit, size_t max_payload, bool last, const Emit& emit);
  void send_request(Bytes unit, uint32_t view_id, size_t max_payload, const Emit& emit);
  void send_answer(Bytes unit, const wire::AnswerView& answer, size_t max_payload, const Emit& emit);

  // How many requests before the newest one go along with it, and of how many views.
  static constexpr size_t kPredecessors = 2, kViews = 64;

  wire::UnitKind kind_;
  Recent<std::vector<std::vector<uint8_t>>> requests_{kViews};  // the oldest first
  ByteBuffer part_;
  uint16_t next_unit_ = 0;
  Stats stats_;
};

// Says when the next packets may leave so that a burst is spread out to a rate. Times in nanoseconds of any clock. Time
// that nothing was sent in is not made up for. Packets may leave a little ahead of their time: what is soon over does
// not have to wait. Not thread-safe.
class Pacer {
 public:
  // When the next packet may leave, not before `now`. A clock on which what was sent last lies in the future is another
  // one, or has been set back: nothing waits for that.
  uint64_t next(uint64_t now) {
    if (next_ && *next_ > now + lasts_ + 2 * kAhead) next_.reset();
    return std::max(now + kAhead, next_.value_or(now)) - kAhead;
  }
  // `bytes` leave at `time`, the latest that next() has said; `bits_per_second` not 0.
  void sent(uint64_t time, uint64_t bytes, uint64_t bits_per_second) {
    lasts_ = static_cast<uint64_t>(8e9 * static_cast<double>(bytes) / static_cast<double>(bits_per_second));
    next_ = std::max(time, next_.value_or(time)) + lasts_;
  }
  void clear() { next_.reset(); }

  static constexpr uint64_t kAhead = 250'000;  // nanoseconds: 31 KB at a gigabit per second

 private:
  std::optional<uint64_t> next_;
  uint64_t lasts_ = 0;  // at the rate, what was sent last
};

}  // namespace lf::rtp
