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

// Notes which of one source's latest packets have come, by their sequence numbers (RFC 3550, appendix A.1): tells
// duplicates from packets that were overtaken, and counts those that are missing. Nothing but duplicates is to be
// dropped. Not thread-safe.
class SequenceWindow {
 public:
  enum class Verdict {
    kNew,
    kDuplicate,
    kRestarted,  // the packet is new, and its sender has begun anew
  };
  Verdict add(uint16_t sequence, uint32_t timestamp);

  // Packets passed over by later ones and not come since.
  uint64_t lost() const { return lost_; }

  // How far back duplicates are known: 5 ms at 200,000 packets a second.
  static constexpr int kSize = 1024;
  // More than this ahead, or further back than kSize, is no loss, but a sender that has begun anew, if the packet after
  // it comes as well.
  static constexpr int kMaxJump = 3000;

 private:
  enum class State : uint8_t { kUnknown, kMissing, kSeen };
  struct Slot {
    State state = State::kUnknown;
    uint32_t timestamp = 0;  // time of the packet: two packets with one number and two times are no duplicates
  };
  void restart(uint16_t sequence, uint32_t timestamp);
  Slot& slot(uint16_t sequence) { return slots_[sequence % kSize]; }

  bool started_ = false;
  uint16_t newest_ = 0;
  std::optional<uint16_t> restart_at_;
  uint64_t lost_ = 0;
  std::array<Slot, kSize> slots_;
};

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

struct Packet {
  uint32_t source = 0;    // SSRC
  uint16_t sequence = 0;  // sequence number of the RTP header
  uint32_t timestamp = 0;
  std::span<const uint8_t> payload;
};

// Makes units of one kind from packets, which may be lost, doubled, out of order or forged; see spec.md. Whatever is
// not exactly one sound unit is dropped and counted; units of a version or type not known are passed on. Memory is
// bounded. Not thread-safe.
class Depacketizer {
 public:
  explicit Depacketizer(wire::UnitKind kind, const Reassembly::Limits& limits = {})
      : kind_(kind), reassembly_(limits) {}

  wire::UnitKind kind() const { return kind_; }

  // Calls `deliver` for each unit that is there with this packet, in order: `bytes` is all of it and lies in the
  // packet, or in `*own` if that is not null, which may be moved from.
  using Deliver = std::function<void(std::span<const uint8_t> bytes, ByteBuffer* own)>;
  void push(const Packet& packet, const Deliver& deliver);

  // Forgets what has come: a new stream begins.
  void clear();
  void set_limits(const Reassembly::Limits& limits) { reassembly_.set_limits(limits); }
  // The depacketizer asks this for each unit that is about to be decoded: one that is not admitted is dropped, and not
  // counted here.
  using Admit = std::function<bool(std::span<const uint8_t> bytes)>;
  void set_admit(Admit admit) { admit_ = std::move(admit); }

  struct Stats {
    uint64_t packets = 0, bytes = 0;  // packets that came, and bytes of their payloads
    uint64_t units = 0;               // units delivered
    uint64_t chunks = 0;              // packets with a piece of a unit
    uint64_t repeated = 0;            // requests that were known already: their repetition was not needed
    uint64_t lost = 0;                // packets missing in their source's sequence
    // Dropped:
    uint64_t superseded = 0;        // requests with more newer ones behind them in their packet than a turn uses
    uint64_t duplicates = 0;        // packets that had come before
    uint64_t bad_packets = 0;       // packets cut short, of another version or an unknown kind
    uint64_t bad_chunks = 0;        // chunks that contradict others, or are of too large a unit
    uint64_t bad_units = 0;         // bytes that are no sound unit of the stream
    uint64_t incomplete_units = 0;  // units given up with chunks missing
  };
  Stats stats() const;

 private:
  // A view's requests come in order: one that is not newer than the last one passed on, and not so old that the viewer
  // must have begun anew, has been seen or is of no more use.
  static constexpr int32_t kMaxRequestAge = 8;
  static constexpr size_t kSources = 64, kViews = 256;
  // The newest of a view and those that go along in case they were lost (Packetizer): others before it in a packet are
  // of no use.
  static constexpr size_t kRequestsOfPacket = 3;
  struct Source {
    SequenceWindow window;
    struct Request {
      uint32_t sequence;
      uint64_t target_time;
    };
    Recent<std::optional<Request>> requests{kViews};  // the last one, by view
  };
  using Bytes = std::span<const uint8_t>;
  static bool is_repeated(Source& source, const RequestHeader& head);
  bool is_sound_request(Source& source, Bytes bytes);
  // `bytes` is exactly one unit with this header.
  bool is_sound(Source& source, Bytes bytes, const wire::UnitHeader& header);
  void take_unit(Source& source, Bytes bytes, const wire::UnitHeader& header, const Deliver& deliver);
  void take_units(Source& source, Bytes bytes, const Deliver& deliver);
  // The requests of a packet that has enough newer ones behind them are taken out.
  void leave_newest(std::vector<Bytes>& units);
  void take_chunk(Source& source, uint32_t id, const Chunk& chunk, const Deliver& deliver);

  wire::UnitKind kind_;
  Recent<Source> sources_{kSources};
  Reassembly reassembly_;
  Admit admit_;
  std::vector<Bytes> units_;  // units of the packet in hand; the memory is kept
  Stats stats_;
};

}  // namespace lf::rtp
