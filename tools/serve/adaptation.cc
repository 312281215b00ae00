// SPDX-License-Identifier: LGPL-2.1-or-later
#include "serve/adaptation.h"

namespace lf::serve {
namespace {

// Packet types and formats of RFC 3550, 4585 and 5104.
enum PacketType : uint8_t { kReceiverReport = 201, kTransportFeedback = 205, kPayloadFeedback = 206 };
constexpr uint8_t kGenericNack = 1, kPictureLoss = 1, kFullIntra = 4;
constexpr size_t kHeader = 8;  // bytes at the start of each packet in a compound, including the SSRC of the sender

uint32_t sender_of(std::span<const uint8_t> packet) {
  return uint32_t{packet[4]} << 24 | uint32_t{packet[5]} << 16 | uint32_t{packet[6]} << 8 | packet[7];
}

bool is_needed(uint8_t type, uint8_t format) {
  switch (type) {
    case kReceiverReport: return true;
    case kTransportFeedback: return format == kGenericNack;
    case kPayloadFeedback: return format == kPictureLoss || format == kFullIntra;
    default: return false;
  }
}

}  // namespace

bool RtcpFilter::accept_encrypted(std::span<const uint8_t> packet, int64_t now) {
  if (packet.empty()) return false;
  if (packet[0] < 128 || packet[0] > 191) return true;
  const bool is_rtcp = packet.size() >= kHeader && packet[1] >= 192 && packet[1] <= 223;
  if (!is_rtcp || packet.size() > kMaxBytes || !packets_.take(now)) return false;
  const uint32_t sender = sender_of(packet);
  if (senders_.contains(sender)) return true;
  if (senders_.size() >= kMaxSenders) return false;
  senders_.insert(sender);
  return true;
}

std::optional<std::vector<uint8_t>> RtcpFilter::filter_compound(std::span<const uint8_t> compound) {
  std::vector<uint8_t> kept;
  for (size_t at = 0; at < compound.size();) {
    const std::span<const uint8_t> rest = compound.subspan(at);
    if (rest.size() < kHeader || rest[0] >> 6 != 2) return kept;
    const size_t size = 4 * (size_t{1} + (size_t{rest[2]} << 8 | rest[3]));
    const bool is_padded = rest[0] & 0x20;
    if (size < kHeader || size > rest.size() || is_padded) return kept;
    if (is_needed(rest[1], rest[0] & 0x1f))
      kept.insert(kept.end(), rest.begin(), rest.begin() + static_cast<ptrdiff_t>(size));
    at += size;
  }
  if (!kept.empty() && kept.size() == compound.size()) return std::nullopt;
  return kept;
}

}  // namespace lf::serve
