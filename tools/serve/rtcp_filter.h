// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstdint>
#include <optional>
#include <set>
#include <span>
#include <vector>

#include "rate_limit.h"

namespace lf::serve {

// Drops packets that a viewer does not need to send. The SRTP decoder and the RTP session keep state for each SSRC; the
// decoder does so before it authenticates the packet. The RTP session of GStreamer 1.22 deadlocks on RTCP feedback of
// format 5 (RFC 6051), and keeps up to 65,536 records for one transport-wide congestion control packet. Times are
// g_get_monotonic_time(). Without locks.
class RtcpFilter {
 public:
  static constexpr size_t kMostSenders = 8;                 // SSRCs of one browser
  static constexpr double kPerSecond = 200, kAtOnce = 400;  // RTCP packets
  static constexpr size_t kMostBytes = 1500;                // of one packet

  // Whether a packet from the network may pass, before it is decrypted (RFC 7983). DTLS may. RTP may not: browsers
  // receive video, and send none. RTCP may from a few SSRCs, at a limited rate.
  bool take_sealed(std::span<const uint8_t> packet, int64_t now);

  // Extracts the receiver reports and the requests for lost packets (generic NACK) and key frames (PLI, FIR) from a
  // decrypted compound packet, up to its first malformed packet. Returns std::nullopt if the whole packet is needed.
  static std::optional<std::vector<uint8_t>> needed_part(std::span<const uint8_t> compound);

 private:
  std::set<uint32_t> senders_;
  TokenBucket packets_{kPerSecond, kAtOnce};
};

}  // namespace lf::serve
