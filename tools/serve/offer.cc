// SPDX-License-Identifier: LGPL-2.1-or-later
#include "offer.h"

#include <array>
#include <bitset>
#include <charconv>
#include <sstream>
#include <string_view>

#include "fingerprint.h"
#include "playout_delay.h"

namespace lf::serve {
namespace {

constexpr char kMalformedFingerprint[] = "an a=fingerprint of the offer is malformed";
constexpr char kTooManyAttributes[] = "the offer has too many formats or attributes";

// The value of "NAME" in "NAME=value;OTHER=value" (RFC 6184: names in either case).
std::string parameter(std::string_view parameters, std::string_view name) {
  while (!parameters.empty()) {
    std::string_view item = parameters.substr(0, parameters.find(';'));
    parameters.remove_prefix(std::min(parameters.size(), item.size() + 1));
    while (item.starts_with(' ')) item.remove_prefix(1);
    if (item.size() > name.size() && item[name.size()] == '=' &&
        g_ascii_strncasecmp(item.data(), name.data(), name.size()) == 0)
      return std::string(item.substr(name.size() + 1));
  }
  return "";
}

// Baseline in the constrained form: profile_idc 42, constraint_set1_flag (RFC 6184, table 5).
bool is_constrained_baseline(const std::string& profile) {
  unsigned value = 0;
  const char* end = profile.data() + profile.size();
  if (profile.size() != 6 || std::from_chars(profile.data(), end, value, 16).ptr != end) return false;
  return value >> 16 == 0x42 && (value >> 8 & 0x40);
}

// What an offer says of a payload type. Refers to the offer's text.
struct Format {
  std::string_view map, parameters;  // rtpmap and fmtp; "" if there is none
};
constexpr size_t kPayloadTypes = 128;

// Takes "PAYLOAD " off the front of an attribute's value. Nothing for a value that begins with no payload type.
std::optional<size_t> take_payload(std::string_view& value) {
  size_t number = 0;
  const char* end = std::from_chars(value.data(), value.data() + value.size(), number).ptr;
  const auto length = static_cast<size_t>(end - value.data());
  if (length == 0 || number >= kPayloadTypes || (length < value.size() && value[length] != ' ')) return std::nullopt;
  value.remove_prefix(std::min(value.size(), length + 1));
  return number;
}

// The first rtpmap and fmtp of each payload type, in one pass over the attributes.
std::array<Format, kPayloadTypes> read_formats(const GstSDPMedia* media) {
  std::array<Format, kPayloadTypes> formats{};
  for (guint i = 0; i < gst_sdp_media_attributes_len(media); i++) {
    const GstSDPAttribute* attribute = gst_sdp_media_get_attribute(media, i);
    const std::string_view key = attribute->key;
    if (!attribute->value || (key != "rtpmap" && key != "fmtp")) continue;
    std::string_view value = attribute->value;
    const auto payload = take_payload(value);
    if (!payload) continue;
    std::string_view& field = key == "rtpmap" ? formats[*payload].map : formats[*payload].parameters;
    if (field.empty()) field = value;
  }
  return formats;
}

bool encodes(std::string_view rtpmap, std::string_view encoding) {
  return rtpmap.size() >= encoding.size() &&
         g_ascii_strncasecmp(rtpmap.data(), encoding.data(), encoding.size()) == 0 &&
         rtpmap.substr(encoding.size()) == "";
}

// Takes the first format of the codec in the offer's order. GStreamer's payloaders know the dynamic payload types from
// 96 on.
bool find_codec(const GstSDPMedia* media, const std::array<Format, kPayloadTypes>& formats, VideoCodec codec,
                Offer& offer) {
  constexpr size_t kLeastPayloadType = 96;
  std::bitset<kPayloadTypes> seen;  // a format that comes again costs nothing
  for (guint i = 0; i < gst_sdp_media_formats_len(media); i++) {
    std::string_view text = gst_sdp_media_get_format(media, i);
    const auto number = take_payload(text);
    if (!number || !text.empty() || *number < kLeastPayloadType || seen[*number]) continue;
    seen.set(*number);
    const auto& [map, parameters] = formats[*number];
    std::string profile;
    if (codec == VideoCodec::kH264) {
      profile = parameter(parameters, "profile-level-id");
      if (!encodes(map, "H264/90000") || parameter(parameters, "packetization-mode") != "1" ||
          !is_constrained_baseline(profile))
        continue;
    } else if (!encodes(map, "VP8/90000")) {
      continue;
    }
    offer.codec = codec;
    offer.payload_type = static_cast<guint>(*number);
    offer.profile = profile;
    return true;
  }
  return false;
}

// The offer's number of a header extension, as far as one byte has it: "3 URI", "3/recvonly URI" (RFC 8285).
guint find_extension(const GstSDPMedia* media, std::string_view uri) {
  for (guint i = 0; i < gst_sdp_media_attributes_len(media); i++) {
    const GstSDPAttribute* attribute = gst_sdp_media_get_attribute(media, i);
    if (!attribute->value || std::string_view(attribute->key) != "extmap") continue;
    const std::string_view text = attribute->value;
    guint number = 0;
    const char* end = std::from_chars(text.data(), text.data() + text.size(), number).ptr;
    const size_t space = text.find(' ');
    if (number < 1 || number > 14 || space == text.npos || (*end != ' ' && *end != '/')) continue;
    if (text.substr(space + 1) == uri) return number;
  }
  return 0;
}

// Of H.264 as it is sent here. Streams may be of any level up to the one named (RFC 6184): webrtcbin would decline an
// offer that does not name just the stream's own.
void set_parameters(const GstSDPMedia* media, guint payload_type, const std::string& profile) {
  GstSDPMedia* writable = const_cast<GstSDPMedia*>(media);  // the message is ours
  const std::string payload = std::to_string(payload_type) + " ";
  const std::string value = payload + "level-asymmetry-allowed=1;packetization-mode=1;profile-level-id=" + profile;
  for (guint i = gst_sdp_media_attributes_len(media); i-- > 0;) {
    const GstSDPAttribute* attribute = gst_sdp_media_get_attribute(media, i);
    if (g_str_equal(attribute->key, "fmtp") && attribute->value && g_str_has_prefix(attribute->value, payload.c_str()))
      gst_sdp_media_remove_attribute(writable, i);
  }
  gst_sdp_media_add_attribute(writable, "fmtp", value.c_str());
}

bool has(const GstSDPMessage* sdp, const GstSDPMedia* media, const char* attribute) {
  return gst_sdp_media_get_attribute_val(media, attribute) || gst_sdp_message_get_attribute_val(sdp, attribute);
}

// "candidate:1 1 udp 2122260223 192.0.2.1 50000 typ host": of one of these addresses, and for UDP.
bool is_of(std::string_view candidate, const std::set<std::string>& addresses) {
  std::string_view fields[5];
  for (std::string_view& field : fields) {
    const size_t space = candidate.find(' ');
    field = candidate.substr(0, space);
    candidate.remove_prefix(space == candidate.npos ? candidate.size() : space + 1);
  }
  return addresses.contains(std::string(fields[4])) && fields[2].size() == 3 &&
         g_ascii_strncasecmp(fields[2].data(), "udp", 3) == 0;
}

void strip_candidates(const GstSDPMedia* media, const std::set<std::string>& known) {
  GstSDPMedia* writable = const_cast<GstSDPMedia*>(media);  // the message is ours
  size_t kept = 0;
  for (guint i = 0; i < gst_sdp_media_attributes_len(media);) {
    const GstSDPAttribute* attribute = gst_sdp_media_get_attribute(media, i);
    const bool candidate = g_ascii_strcasecmp(attribute->key, "candidate") == 0;
    if (candidate && (kept >= Offer::kMaxCandidates || !is_of(attribute->value ? attribute->value : "", known))) {
      gst_sdp_media_remove_attribute(writable, i);
      continue;
    }
    kept += candidate;
    i++;
  }
}

// webrtcbin looks through all attributes for each format, and through all before an attribute to find it.
bool is_too_large(const GstSDPMedia* media) {
  return gst_sdp_media_formats_len(media) > Offer::kMaxFormats ||
         gst_sdp_media_attributes_len(media) > Offer::kMaxAttributes;
}

std::string problem_of(const GstSDPMessage* sdp, const GstSDPMedia* media, const std::string& name) {
  for (const char* attribute : {"ice-ufrag", "ice-pwd", "fingerprint", "setup"})
    if (!has(sdp, media, attribute)) return name + " has no a=" + attribute;
  if (!gst_sdp_media_get_attribute_val(media, "mid")) return name + " has no a=mid";
  if (!gst_sdp_media_get_attribute_val(media, "rtcp-mux") && name == "m=video") return "m=video has no a=rtcp-mux";
  return "";
}

// Returns true if all media share one transport (RFC 9143). WHEP requires that.
bool is_bundled(const GstSDPMessage* sdp) {
  std::set<std::string> bundled;
  for (guint i = 0; i < gst_sdp_message_attributes_len(sdp); i++) {
    const GstSDPAttribute* attribute = gst_sdp_message_get_attribute(sdp, i);
    std::istringstream words(attribute->value ? attribute->value : "");
    std::string word;
    if (!g_str_equal(attribute->key, "group") || !(words >> word) || word != "BUNDLE") continue;
    while (words >> word) bundled.insert(word);
    break;
  }
  const guint media = gst_sdp_message_medias_len(sdp);
  for (guint i = 0; media > 1 && i < media; i++)
    if (!bundled.contains(gst_sdp_media_get_attribute_val(gst_sdp_message_get_media(sdp, i), "mid"))) return false;
  return true;
}

// Adds the fingerprints of the session (no `media`) or of a medium. Returns false if one is malformed.
bool add_fingerprints(const GstSDPMessage* sdp, const GstSDPMedia* media, std::set<std::string>& to) {
  const guint count = media ? gst_sdp_media_attributes_len(media) : gst_sdp_message_attributes_len(sdp);
  for (guint i = 0; i < count; i++) {
    const GstSDPAttribute* attribute =
        media ? gst_sdp_media_get_attribute(media, i) : gst_sdp_message_get_attribute(sdp, i);
    if (!g_str_equal(attribute->key, "fingerprint")) continue;
    const std::string value = attribute->value ? attribute->value : "";
    const FingerprintKind kind = fingerprint_kind(value);
    if (kind == FingerprintKind::kMalformed) return false;
    if (kind == FingerprintKind::kKnown) to.insert(value);
  }
  return true;
}

}  // namespace

const char* to_string(VideoCodec codec) { return codec == VideoCodec::kH264 ? "H264" : "VP8"; }

std::optional<Offer> parse_offer(const std::string& text, bool h264, bool vp8, const std::set<std::string>& known,
                                 std::string* reason) {
  const auto fail = [reason](const std::string& why) {
    if (reason) *reason = why;
    return std::nullopt;
  };
  // GStreamer's parser warns of criticals for what is no text at all.
  if (text.size() > Offer::kMaxBytes) return fail("the offer is too long");
  if (!text.starts_with("v=0") || text.find('\0') != text.npos || !g_utf8_validate(text.data(), -1, nullptr))
    return fail("the offer is not SDP");
  GstSDPMessage* sdp = nullptr;
  const GstSDPResult result = gst_sdp_message_new_from_text(text.c_str(), &sdp);
  Offer offer{SdpPtr(sdp)};
  if (result != GST_SDP_OK || !sdp) return fail("the offer is not SDP");
  const guint media = gst_sdp_message_medias_len(sdp);
  if (media == 0 || media > Offer::kMaxMedia) return fail("the offer has no media, or too many");
  if (gst_sdp_message_attributes_len(sdp) > Offer::kMaxAttributes) return fail(kTooManyAttributes);
  const GstSDPMedia* video = nullptr;
  bool application = false;
  for (guint i = 0; i < media; i++) {
    const GstSDPMedia* m = gst_sdp_message_get_media(sdp, i);
    const std::string kind = gst_sdp_media_get_media(m) ? gst_sdp_media_get_media(m) : "";
    if (kind != "video" && kind != "application" && kind != "audio")
      return fail("the offer has media of an unknown kind");
    if (is_too_large(m)) return fail(kTooManyAttributes);
    const std::string problem = problem_of(sdp, m, "m=" + kind);
    if (!problem.empty()) return fail(problem);
    if (!add_fingerprints(sdp, m, offer.fingerprints)) return fail(kMalformedFingerprint);
    if (kind == "video" && video) return fail("the offer has more than one video");
    if (kind == "application" && application) return fail("the offer has more than one data channel association");
    if (kind == "video") video = m;
    application = application || kind == "application";
    strip_candidates(m, known);
  }
  if (!video) return fail("the offer has no video");
  if (!is_bundled(sdp)) return fail("the offer does not bundle its media (a=group:BUNDLE with every a=mid)");
  if (!add_fingerprints(sdp, nullptr, offer.fingerprints)) return fail(kMalformedFingerprint);
  if (offer.fingerprints.empty()) return fail("the offer has no a=fingerprint of SHA-256, SHA-384 or SHA-512");
  if (gst_sdp_media_get_attribute_val(video, "sendonly") || gst_sdp_media_get_attribute_val(video, "inactive"))
    return fail("the offer does not receive video");
  const auto formats = read_formats(video);
  if (!(h264 && find_codec(video, formats, VideoCodec::kH264, offer)) &&
      !(vp8 && find_codec(video, formats, VideoCodec::kVp8, offer)))
    return fail(
        "the offer has no codec that this server can send: H.264 (constrained baseline, mode 1) or VP8 with a "
        "payload type from 96 to 127");
  offer.playout_delay = find_extension(video, kPlayoutDelayUri);
  if (offer.codec == VideoCodec::kH264) set_parameters(video, offer.payload_type, offer.profile);
  return offer;
}

void name_profile(GstSDPMessage* answer, const Offer& offer) {
  if (offer.codec != VideoCodec::kH264) return;
  for (guint i = 0; i < gst_sdp_message_medias_len(answer); i++)
    if (const GstSDPMedia* media = gst_sdp_message_get_media(answer, i);
        g_strcmp0(gst_sdp_media_get_media(media), "video") == 0)
      set_parameters(media, offer.payload_type, offer.profile);
}

}  // namespace lf::serve
