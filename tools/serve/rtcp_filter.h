// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstdint>
#include <optional>
#include <set>
#include <span>
#include <vector>

#include "rate_limit.h"

namespace lf::serve {

// Keeps packets away from the SRTP decoder and the RTP session that a browser does not need to send to watch a video.
// Both keep state for each SSRC that they see, the decoder even before it has authenticated the packet. The session of
// GStreamer 1.22 blocks for ever on a feedback packet of format 5 (RFC 6051), and keeps up to 65,536 records for one
// feedback packet about transport-wide congestion control. Times are g_get_monotonic_time(). Without locks.
class RtcpFilter {
 public:
  static constexpr size_t kMostSenders = 8;                 // SSRCs of one browser
  static constexpr double kPerSecond = 200, kAtOnce = 400;  // RTCP packets
  static constexpr size_t kMostBytes = 1500;                // of one packet

  // Whether a packet from the network may pass, before it is decrypted (RFC 7983). DTLS may. RTP may not: browsers
  // receive video, and send none. RTCP may from a few SSRCs, at a limited rate.
  bool take_sealed(std::span<const uint8_t> packet, int64_t now);

  // Of a decrypted compound packet the receiver reports and the requests for lost packets (generic NACK) and key frames
  // (PLI, FIR). Empty if there are none, or the packet is malformed. std::nullopt: the whole packet.
  static std::optional<std::vector<uint8_t>> needed_part(std::span<const uint8_t> compound);

 private:
  std::set<uint32_t> senders_;
  TokenBucket packets_{kPerSecond, kAtOnce};
};

}  // namespace lf::serve
