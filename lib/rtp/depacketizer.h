// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <map>
#include <optional>
#include <span>
#include <utility>
#include <vector>

#include "base/memory.h"
#include "rtp/packetizer.h"
#include "view/view_request.h"
#include "wire/unit.h"

namespace lf::rtp {

// Tracks the latest sequence numbers of a source (RFC 3550, appendix A.1). Distinguishes duplicates from reordered
// packets and counts missing packets. Only duplicates should be dropped. Not thread-safe.
class SequenceWindow {
 public:
  enum class Verdict {
    kNew,
    kDuplicate,
    kRestarted,  // new packet; the sender has restarted
  };
  Verdict add(uint16_t sequence, uint32_t timestamp);

  // Number of missing packets that have not arrived late.
  uint64_t lost() const { return lost_; }

  // Window for detecting duplicates: 5 ms at 200,000 packets per second.
  static constexpr int kSize = 1024;
  // A larger jump ahead, or one further back than kSize, means that the sender restarted instead of a loss, if the next
  // packet continues from there.
  static constexpr int kMaxJump = 3000;

 private:
  enum class State : uint8_t { kUnknown, kMissing, kSeen };
  struct Slot {
    State state = State::kUnknown;
    uint32_t timestamp = 0;  // packets with equal sequence numbers and different timestamps are not duplicates
  };
  void restart(uint16_t sequence, uint32_t timestamp);
  Slot& slot(uint16_t sequence) { return slots_[sequence % kSize]; }

  bool started_ = false;
  uint16_t newest_ = 0;
  std::optional<uint16_t> restart_at_;
  uint64_t lost_ = 0;
  std::array<Slot, kSize> slots_;
};

// Reassembles units from chunks in any order. Memory grows only with received bytes, never with the size in a header,
// and is bounded: the oldest incomplete units are dropped first. Not thread-safe.
class Reassembly {
 public:
  struct Limits {
    size_t bytes = size_t{64} << 20;  // maximum total of all incomplete units, and of a single unit
    size_t units = 64;
  };
  explicit Reassembly(const Limits& limits) : limits_(limits) {}

  enum class Result {
    kKept,
    kComplete,  // `unit` is set
    kDuplicate,
    kBad,  // the chunk contradicts earlier chunks: different unit size, or an overlap
    kTooLarge,
  };
  Result add(uint32_t source, const Chunk& chunk, ByteBuffer& unit);

  void set_limits(const Limits& limits) { limits_ = limits; }
  // Discards all incomplete units and counts them as dropped.
  void clear();
  uint64_t dropped() const { return dropped_; }
  size_t bytes() const { return bytes_; }
  size_t units() const { return partial_units_.size(); }

  // Overhead of a chunk in the memory limit, bytes.
  static constexpr size_t kChunkCost = 96;

 private:
  struct Place {
    size_t size, at;  // bytes of the chunk, and its offset in PartialUnit::bytes
  };
  struct PartialUnit {
    uint32_t source;
    uint16_t number;
    uint32_t size;
    bool in_order = true;                // `bytes` is a prefix of the unit
    ByteBuffer bytes;                    // chunks in order of arrival
    std::map<uint32_t, Place> chunks{};  // by offset in the unit
    size_t cost() const { return bytes.size() + chunks.size() * kChunkCost; }
  };
  void drop_oldest();
  static ByteBuffer finish(PartialUnit& making);

  Limits limits_;
  std::vector<PartialUnit> partial_units_;
  size_t bytes_ = 0;
  uint64_t dropped_ = 0;
};

struct Packet {
  uint32_t source = 0;  // SSRC
  uint16_t sequence = 0;
  uint32_t timestamp = 0;
  std::span<const uint8_t> payload;
};

// Restores units of one kind from packets, which may be lost, duplicated, reordered or forged; see spec.md. Invalid
// units are dropped and counted; units of unknown version or type are passed on. Memory is bounded. Not thread-safe.
class Depacketizer {
 public:
  explicit Depacketizer(wire::UnitKind kind, const Reassembly::Limits& limits = {})
      : kind_(kind), reassembly_(limits) {}

  wire::UnitKind kind() const { return kind_; }

  // Calls `deliver` for each unit that this packet completes, in order. `bytes` is the whole unit, in the packet or in
  // `*own`. `own` may be null; otherwise it may be moved from.
  using Deliver = std::function<void(std::span<const uint8_t> bytes, ByteBuffer* own)>;
  void push(const Packet& packet, const Deliver& deliver);

  void clear();
  void set_limits(const Reassembly::Limits& limits) { reassembly_.set_limits(limits); }
  // Called for each unit before decoding. A rejected unit is dropped and not counted here.
  using UnitFilter = std::function<bool(std::span<const uint8_t> bytes)>;
  void set_filter(UnitFilter admit) { filter_ = std::move(admit); }

  struct Stats {
    uint64_t packets = 0, bytes = 0;  // received packets, and their payload bytes
    uint64_t units = 0;
    uint64_t chunks = 0;    // packets with a part of a unit
    uint64_t repeated = 0;  // redundant copies of requests received before
    uint64_t lost = 0;      // gaps in the sequence numbers
    // Dropped:
    uint64_t superseded = 0;  // requests with too many newer requests in the same packet
    uint64_t duplicates = 0;
    uint64_t bad_packets = 0;  // truncated packets, other version, unknown kind
    uint64_t bad_chunks = 0;   // chunks that contradict other chunks, or whose unit is too large
    uint64_t bad_units = 0;
    uint64_t incomplete_units = 0;  // units discarded with missing chunks
  };
  Stats stats() const;

 private:
  // A view's requests are delivered in order. A request that is not newer than the last one is a duplicate or obsolete,
  // unless it is so old that the viewer must have restarted.
  static constexpr int32_t kMaxRequestAge = 8;
  static constexpr size_t kSources = 64, kViews = 256;
  // The newest request of a view and its repeated predecessors (see Packetizer); older requests are obsolete.
  static constexpr size_t kMaxRequestsPerPacket = 3;
  struct Source {
    SequenceWindow window;
    struct Request {
      uint32_t sequence;
      uint64_t target_time;
    };
    LruMap<std::optional<Request>> requests{kViews};
  };
  using Bytes = std::span<const uint8_t>;
  static bool is_repeated(Source& source, const RequestHeader& head);
  bool is_sound_request(Source& source, Bytes bytes);
  // `bytes` is exactly one unit with this header.
  bool is_sound(Source& source, Bytes bytes, const wire::UnitHeader& header);
  void take_unit(Source& source, Bytes bytes, const wire::UnitHeader& header, const Deliver& deliver);
  void take_units(Source& source, Bytes bytes, const Deliver& deliver);
  // Removes requests with enough newer requests in the packet.
  void keep_newest(std::vector<Bytes>& units);
  void take_chunk(Source& source, uint32_t id, const Chunk& chunk, const Deliver& deliver);

  wire::UnitKind kind_;
  LruMap<Source> sources_{kSources};
  Reassembly reassembly_;
  UnitFilter filter_;
  std::vector<Bytes> units_;
  Stats stats_;
};

}  // namespace lf::rtp
