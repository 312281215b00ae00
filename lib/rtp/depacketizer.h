// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <span>
#include <utility>
#include <vector>

#include "base/byte_buffer.h"
#include "rtp/payload_format.h"
#include "rtp/reassembly.h"
#include "rtp/recent.h"
#include "rtp/sequence_window.h"
#include "view/view_request.h"
#include "wire/unit.h"

namespace lf::rtp {

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
