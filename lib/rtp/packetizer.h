// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <span>
#include <string>
#include <vector>

#include "base/byte_buffer.h"
#include "rtp/payload_format.h"
#include "rtp/recent.h"
#include "wire/answer_parser.h"
#include "wire/unit.h"

namespace lf::rtp {

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

}  // namespace lf::rtp
