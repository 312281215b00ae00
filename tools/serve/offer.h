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

// STUN and TURN servers (RFC 7064, RFC 7065) for viewers and for us. Immutable; thread-safe.
class IceServers {
 public:
  static constexpr int64_t kLifetime = 12 * 3600;  // seconds that credentials made of a secret are good for

  IceServers() = default;
  // `uris`: "stun:HOST", "turn:HOST:PORT?transport=udp", "turns:HOST", ... `credentials`: for TURN, either "USER
  // PASSWORD" or one word, the secret that is shared with the server, of which credentials are made that end (coturn:
  // use-auth-secret, static-auth-secret). Throws Error.
  IceServers(const std::vector<std::string>& uris, const std::string& credentials);

  bool empty() const { return servers_.empty(); }
  // The value of a Link header (RFC 9725, 4.6); `now`: seconds since 1970.
  std::string links(int64_t now) const;
  // The servers as webrtcbin takes them: "stun://HOST:PORT", "turn://USER:PASSWORD@HOST:PORT?transport=udp".
  std::vector<std::string> for_webrtcbin(int64_t now) const;
  // Addresses of the TURN servers, as text: packets that they pass on come from there. Blocks while names are looked
  // up; who is not found is said in the log.
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

// The fingerprint of a certificate in SDP, "sha-256 AA:BB:...", as RFC 8122 defines it. It ties the peer of a DTLS
// connection to the offer: webrtcbin itself takes any peer.
enum class FingerprintKind { kKnown, kOfAnotherHash, kMalformed };
// Known hashes: SHA-256, SHA-384, SHA-512.
FingerprintKind fingerprint_kind(std::string_view text);

// Whether the certificate has one of these fingerprints, which are of known hashes.
bool has_fingerprint(const std::string& certificate_pem, const std::set<std::string>& fingerprints);

enum class VideoCodec { kH264, kVp8 };
const char* to_string(VideoCodec codec);

struct FreeSdp {
  void operator()(GstSDPMessage* sdp) const { gst_sdp_message_free(sdp); }
};
using SdpPtr = std::unique_ptr<GstSDPMessage, FreeSdp>;

// RTP header extension by which receivers that know it show every picture as soon as it is decoded, and keep none back
// to make the gaps between pictures even. docs/measurements.md says what that saves.
inline constexpr char kPlayoutDelayUri[] = "http://www.webrtc.org/experiments/rtp-hdrext/playout-delay";

// What a browser offers to receive, checked as far as webrtcbin takes it for granted.
struct Offer {
  static constexpr size_t kMaxBytes = 65536;
  static constexpr guint kMaxMedia = 16;
  static constexpr guint kMaxFormats = 128;     // formats of a medium: payload types have seven bits
  static constexpr guint kMaxAttributes = 512;  // attributes of a medium or the session; browsers send up to 250
  static constexpr size_t kMaxCandidates = 4;   // candidates of one medium that are kept

  SdpPtr sdp;
  VideoCodec codec;
  guint payload_type;                  // the offer's own number for the codec
  std::string profile;                 // kH264: profile-level-id
  std::set<std::string> fingerprints;  // the browser certificate's; at least one
  guint playout_delay;                 // the offer's own number for the RTP header extension; 0: it is not offered
};

// Parses an offer in a time proportional to its length. `h264`, `vp8`: the codecs that can be encoded here; H.264 goes
// first. Keeps only candidates with an address in `known` (the viewer's own and relays), so that no offer makes the
// server send packets to somebody else. Returns nothing, and the reason, for an offer that can't be answered.
std::optional<Offer> parse_offer(const std::string& text, bool h264, bool vp8, const std::set<std::string>& known,
                                 std::string* reason);

// Gives the chosen codec the profile and level of the offer in the answer, where browsers look for it; webrtcbin leaves
// it out.
void name_profile(GstSDPMessage* answer, const Offer& offer);

}  // namespace lf::serve
