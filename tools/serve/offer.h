// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <gst/sdp/sdp.h>

#include <memory>
#include <optional>
#include <set>
#include <string>

namespace lf::serve {

enum class VideoCodec { kH264, kVp8 };
const char* to_string(VideoCodec codec);

struct FreeSdp {
  void operator()(GstSDPMessage* sdp) const { gst_sdp_message_free(sdp); }
};
using SdpPtr = std::unique_ptr<GstSDPMessage, FreeSdp>;

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
