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

// The STUN and TURN servers (RFC 7064, RFC 7065) that help viewers and this server to reach each other. Immutable and
// therefore thread-safe.
class IceServers {
 public:
  static constexpr int64_t kLifetime = 12 * 3600;  // validity of credentials that are derived from a secret, seconds

  IceServers() = default;
  // `uris` are, for example, "stun:HOST" or "turn:HOST:PORT?transport=udp". `credentials` are for TURN: either "USER
  // PASSWORD", or one word, the secret that the TURN server shares with this server (coturn: use-auth-secret and
  // static-auth-secret). Temporary credentials are derived from a secret. Throws Error.
  IceServers(const std::vector<std::string>& uris, const std::string& credentials);

  bool empty() const { return servers_.empty(); }
  // Returns the value of the header Link, which lists the servers for the browser (RFC 9725, 4.6). `now` is the time in
  // seconds since 1970.
  std::string links(int64_t now) const;
  std::vector<std::string> for_webrtcbin(int64_t now) const;
  // Returns the IP addresses of the TURN servers, the sources of relayed packets. Blocks while names are resolved.
  // Names that cannot be resolved are logged.
  std::set<std::string> relays() const;

 private:
  struct Server {
    std::string scheme, host, query;  // for example "turn", "example.org:3478" and "?transport=udp"
  };
  struct Credentials {
    std::string user, password;
  };
  Credentials credentials(int64_t now) const;

  std::vector<Server> servers_;
  Credentials fixed_;
  std::string secret_;
};

// A certificate fingerprint in SDP, such as "sha-256 AA:BB:..." (RFC 8122). It proves that the DTLS peer is the browser
// that sent the offer. The server must check this itself, because webrtcbin accepts any peer.
enum class FingerprintKind { kKnown, kUnknownHash, kMalformed };
FingerprintKind fingerprint_kind(std::string_view text);

// True if the certificate has one of these fingerprints. All fingerprints must use known hashes.
bool has_fingerprint(const std::string& certificate_pem, const std::set<std::string>& fingerprints);

enum class VideoCodec { kH264, kVp8 };
const char* to_string(VideoCodec codec);

struct FreeSdp {
  void operator()(GstSDPMessage* sdp) const { gst_sdp_message_free(sdp); }
};
using SdpPtr = std::unique_ptr<GstSDPMessage, FreeSdp>;

// An RTP header extension that makes browsers show each picture as soon as it is decoded. Without it, browsers delay
// pictures to smooth their intervals. docs/performance.md has the latency that this saves.
inline constexpr char kPlayoutDelayUri[] = "http://www.webrtc.org/experiments/rtp-hdrext/playout-delay";

// A checked SDP offer of a browser. webrtcbin accepts offers that are harmful or cannot work, so parse_offer() checks
// each offer first, and rejects such offers.
struct Offer {
  static constexpr size_t kMaxBytes = 65536;
  static constexpr guint kMaxMedia = 16;
  static constexpr guint kMaxFormats = 128;  // maximum number of formats per medium; payload types have seven bits
  // maximum number of attributes per medium or session; browsers send up to 250
  static constexpr guint kMaxAttributes = 512;
  static constexpr size_t kMaxCandidates = 4;

  SdpPtr sdp;
  VideoCodec codec;
  guint payload_type;
  std::string profile;  // kH264: profile-level-id
  std::set<std::string> fingerprints;
  guint playout_delay;  // id of the extension kPlayoutDelayUri in the offer; 0 if it is not offered
};

// Parses an offer, in a time proportional to its length. `h264` and `vp8`: these encoders are available; H.264 is
// preferred. ICE candidates are kept only if their address is in `known` (the viewer's own address and relays), so that
// no offer can make the server send packets to third parties. Returns std::nullopt and a reason if the offer cannot be
// answered.
std::optional<Offer> parse_offer(const std::string& text, bool h264, bool vp8, const std::set<std::string>& known,
                                 std::string* reason);

// Copies the profile and level of the selected codec from the offer to the answer, because browsers expect both and
// webrtcbin omits both of them in its answers.
void set_profile(GstSDPMessage* answer, const Offer& offer);

}  // namespace lf::serve
