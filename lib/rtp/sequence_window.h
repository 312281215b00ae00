// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <array>
#include <cstdint>
#include <optional>

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

}  // namespace lf::rtp
