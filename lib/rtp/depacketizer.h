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

// Detects duplicate and lost RTP packets of one sender by their sequence numbers, as in RFC 3550, appendix A.1. Packets
// may arrive in another order than they were sent; a packet is a duplicate only if the same packet has already arrived.
// Not thread-safe.
class SequenceWindow {
 public:
  enum class Verdict {
    kNew,
    kDuplicate,
    kRestarted,  // the packet is new, and its sender has restarted
  };
  Verdict add(uint16_t sequence, uint32_t timestamp);

  uint64_t lost() const { return lost_; }

  // Size of the window for detecting duplicates, in packets: 5 ms at 200,000 packets per second.
  static constexpr int kSize = 1024;
  // A jump of more than kMaxJump packets ahead, or more than kSize back, suggests that the sender has restarted. The
  // next packet confirms the restart if it continues from there; otherwise the jump was a stray packet.
  static constexpr int kMaxJump = 3000;

 private:
  enum class State : uint8_t { kUnknown, kMissing, kSeen };
  struct Slot {
    State state = State::kUnknown;
    // a packet with a different timestamp is not a duplicate, even if the sequence number is equal
    uint32_t timestamp = 0;
  };
  void restart(uint16_t sequence, uint32_t timestamp);
  Slot& slot(uint16_t sequence) { return slots_[sequence % kSize]; }

  bool started_ = false;
  uint16_t newest_ = 0;
  std::optional<uint16_t> restart_at_;
  uint64_t lost_ = 0;
  std::array<Slot, kSize> slots_;
};

// Puts together the units that do not fit in one packet. A sender splits such a unit (a message of the wire format)
// into chunks of one packet each, which may arrive in any order. Memory grows with the received bytes and never with
// the size in a header, so a forged header does no harm. If a limit is exceeded, the oldest incomplete units are
// dropped. Not thread-safe.
class Reassembly {
 public:
  struct Limits {
    size_t bytes = size_t{64} << 20;  // maximum total of all incomplete units, and maximum size of one unit
    size_t units = 64;
  };
  explicit Reassembly(const Limits& limits) : limits_(limits) {}

  enum class Result {
    kKept,
    kComplete,  // `unit` receives the unit
    kDuplicate,
    kBad,  // the chunk contradicts earlier chunks: another unit size, or an overlap
    kTooLarge,
  };
  // Adds a chunk from the sender with the SSRC `source`.
  Result add(uint32_t source, const Chunk& chunk, ByteBuffer& unit);

  void set_limits(const Limits& limits) { limits_ = limits; }
  void clear();
  uint64_t dropped() const { return dropped_; }
  size_t bytes() const { return bytes_; }
  size_t units() const { return partial_units_.size(); }

  // Bytes that each chunk counts towards the memory limit, in addition to its content.
  static constexpr size_t kChunkCost = 96;

 private:
  struct Place {
    size_t size, at;  // bytes of the chunk, and its offset in PartialUnit::bytes
  };
  struct PartialUnit {
    uint32_t source;
    uint16_t number;
    uint32_t size;
    bool in_order = true;  // the bytes are the beginning of the unit, without gaps
    ByteBuffer bytes;      // in order of arrival
    std::map<uint32_t, Place> chunks{};
    size_t cost() const { return bytes.size() + chunks.size() * kChunkCost; }
  };
  void drop_oldest();
  static ByteBuffer finish(PartialUnit& making);

  Limits limits_;
  std::vector<PartialUnit> partial_units_;
  size_t bytes_ = 0;
  uint64_t dropped_ = 0;
};

// The parts of an RTP packet that Depacketizer needs: SSRC, sequence number, timestamp and payload.
struct Packet {
  uint32_t source = 0;
  uint16_t sequence = 0;
  uint32_t timestamp = 0;
  std::span<const uint8_t> payload;
};

// Restores units of one kind from packets, which may be lost, duplicated, reordered or forged; see spec.md. Invalid
// units are dropped and counted. Units of an unknown version or type are passed on, so that old receivers can forward
// new messages. Memory is bounded. Not thread-safe.
class Depacketizer {
 public:
  explicit Depacketizer(wire::UnitKind kind, const Reassembly::Limits& limits = {})
      : kind_(kind), reassembly_(limits) {}

  wire::UnitKind kind() const { return kind_; }

  // Calls `deliver` for each unit that this packet completes, in order. `bytes` is the whole unit and is valid during
  // the call. If `own` is not null, `*own` contains the unit and may be moved from.
  using Deliver = std::function<void(std::span<const uint8_t> bytes, ByteBuffer* own)>;
  void push(const Packet& packet, const Deliver& deliver);

  void clear();
  void set_limits(const Reassembly::Limits& limits) { reassembly_.set_limits(limits); }
  // The filter is called for each unit before decoding. A unit that it rejects is dropped without being counted here.
  using UnitFilter = std::function<bool(std::span<const uint8_t> bytes)>;
  void set_filter(UnitFilter admit) { filter_ = std::move(admit); }

  struct Stats {
    uint64_t packets = 0, bytes = 0;  // payload bytes, without RTP headers
    uint64_t units = 0;
    uint64_t chunks = 0;    // packets with a part of a larger unit
    uint64_t repeated = 0;  // further copies of requests, which senders repeat in case of packet loss
    uint64_t lost = 0;
    // The following units and packets were dropped:
    uint64_t superseded = 0;  // requests with enough newer requests in the same packet
    uint64_t duplicates = 0;
    uint64_t bad_packets = 0;  // truncated, of another version, or of an unknown kind
    uint64_t bad_chunks = 0;   // contradict other chunks, or their unit is too large
    uint64_t bad_units = 0;
    uint64_t incomplete_units = 0;  // units that were discarded before all chunks had arrived
  };
  Stats stats() const;

 private:
  // Requests of a view are delivered in order. A request that is not newer than the latest is a duplicate or obsolete.
  // If it is kMaxRequestAge or more requests older, the viewer has restarted, and the request is accepted.
  static constexpr int32_t kMaxRequestAge = 8;
  static constexpr size_t kSources = 64, kViews = 256;
  // A packet contains the newest request of a view and two repeated ones (see Packetizer). More are obsolete.
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
  bool is_sound(Source& source, Bytes bytes, const wire::UnitHeader& header);
  void take_unit(Source& source, Bytes bytes, const wire::UnitHeader& header, const Deliver& deliver);
  void take_units(Source& source, Bytes bytes, const Deliver& deliver);
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
