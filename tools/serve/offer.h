// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <string_view>
#include <vector>

#include <gst/sdp/sdp.h>

namespace lf::serve {

// STUN and TURN servers (RFC 7064, RFC 7065) for viewers and the server. Immutable; thread-safe.
class IceServers {
 public:
  static constexpr int64_t kLifetime = 12 * 3600;  // seconds of validity of credentials derived from a secret

  IceServers() = default;
  // `uris`: "stun:HOST", "turn:HOST:PORT?transport=udp", "turns:HOST", ... `credentials`: for TURN, either "USER
  // PASSWORD", or a single word: the secret shared with the TURN server, from which temporary credentials are derived
  // (coturn: use-auth-secret, static-auth-secret). Throws Error.
  IceServers(const std::vector<std::string>& uris, const std::string& credentials);

  bool empty() const { return servers_.empty(); }
  // Returns the value of a Link header (RFC 9725, 4.6); `now`: seconds since 1970.
  std::string links(int64_t now) const;
  // Returns the servers in webrtcbin's format: "stun://HOST:PORT", "turn://USER:PASSWORD@HOST:PORT?transport=udp".
  std::vector<std::string> for_webrtcbin(int64_t now) const;
  // Returns the IP addresses of the TURN servers, the sources of relayed packets. Blocks while names are resolved;
  // unknown names are logged.
  std::set<std::string> relays() const;

 private:
  struct Server {
    std::string scheme, host, query;  // "turn", "example.org:3478", "?transport=udp"
  };
  struct Credentials {
    std::string user, password;
  };
  Credentials credentials(int64_t now) const;

  std::vector<Server> servers_;
  Credentials fixed_;
  std::string secret_;
};

// A certificate fingerprint in SDP, "sha-256 AA:BB:..." (RFC 8122). It binds the DTLS peer to the offer; webrtcbin
// itself accepts any peer.
enum class FingerprintKind { kKnown, kUnknownHash, kMalformed };
// Known hashes: SHA-256, SHA-384, SHA-512.
FingerprintKind fingerprint_kind(std::string_view text);

// True if the certificate has one of these fingerprints, which must use known hashes.
bool has_fingerprint(const std::string& certificate_pem, const std::set<std::string>& fingerprints);

enum class VideoCodec { kH264, kVp8 };
const char* to_string(VideoCodec codec);

struct FreeSdp {
  void operator()(GstSDPMessage* sdp) const { gst_sdp_message_free(sdp); }
};
using SdpPtr = std::unique_ptr<GstSDPMessage, FreeSdp>;

// RTP header extension that makes receivers show every picture as soon as it is decoded, without smoothing the
// intervals. docs/performance.md has the latency it saves.
inline constexpr char kPlayoutDelayUri[] = "http://www.webrtc.org/experiments/rtp-hdrext/playout-delay";

// A browser's offer, validated where webrtcbin does not.
struct Offer {
  static constexpr size_t kMaxBytes = 65536;
  static constexpr guint kMaxMedia = 16;
  static constexpr guint kMaxFormats = 128;     // per medium; payload types have seven bits
  static constexpr guint kMaxAttributes = 512;  // per medium or session; browsers send up to 250
  static constexpr size_t kMaxCandidates = 4;

  SdpPtr sdp;
  VideoCodec codec;
  guint payload_type;
  std::string profile;                 // kH264: profile-level-id
  std::set<std::string> fingerprints;  // fingerprints of the browser's certificate; at least one
  guint playout_delay;                 // id of the RTP header extension in the offer; 0: not offered
};

// Parses an offer in linear time. `h264`, `vp8`: available encoders; H.264 is preferred. Keeps only candidates with an
// address in `known` (the viewer's own address and relays), so that no offer can make the server send packets to third
// parties. Returns std::nullopt and a reason if the offer can't be answered.
std::optional<Offer> parse_offer(const std::string& text, bool h264, bool vp8, const std::set<std::string>& known,
                                 std::string* reason);

// Copies the profile and level of the chosen codec from the offer to the answer, because browsers expect it and
// webrtcbin omits it.
void set_profile(GstSDPMessage* answer, const Offer& offer);

}  // namespace lf::serve
