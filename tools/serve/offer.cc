// SPDX-License-Identifier: LGPL-2.1-or-later
#include "serve/offer.h"

#include <algorithm>
#include <array>
#include <bitset>
#include <cctype>
#include <charconv>
#include <cstring>
#include <optional>
#include <sstream>
#include <string_view>

#include <gio/gio.h>
#include <glib.h>

#include "base/text.h"
#include "serve/process.h"

namespace lf::serve {
namespace {

// Rejects characters that could end a header.
bool is_host(const std::string& text) {
  return !text.empty() &&
         std::ranges::all_of(text, [](char c) { return g_ascii_isalnum(c) || (c && std::strchr(".-:[]", c)); });
}

bool is_word(const std::string& text) {
  return !text.empty() &&
         std::ranges::all_of(text, [](char c) { return c > ' ' && c <= '~' && c != '"' && c != '\\'; });
}

bool has_port(const std::string& host) {
  const size_t colon = host.rfind(':');
  return colon != host.npos && host.find(']', colon) == host.npos;
}

std::string hmac_sha1(const std::string& secret, const std::string& text) {
  GHmac* hmac = g_hmac_new(G_CHECKSUM_SHA1, reinterpret_cast<const guchar*>(secret.data()), secret.size());
  g_hmac_update(hmac, reinterpret_cast<const guchar*>(text.data()), static_cast<gssize>(text.size()));
  guint8 digest[20];
  gsize size = sizeof digest;
  g_hmac_get_digest(hmac, digest, &size);
  g_hmac_unref(hmac);
  g_autofree gchar* base64 = g_base64_encode(digest, size);
  return base64;
}

std::string escaped(const std::string& text) {
  g_autofree gchar* result = g_uri_escape_string(text.c_str(), nullptr, FALSE);
  return result;
}

}  // namespace

IceServers::IceServers(const std::vector<std::string>& uris, const std::string& credentials) {
  for (const std::string& uri : uris) {
    const size_t colon = uri.find(':'), question = uri.find('?');
    if (colon == uri.npos) throw Error("--ice-server " + uri + ": must have the form stun:HOST:PORT or turn:HOST:PORT");
    Server server{uri.substr(0, colon), uri.substr(colon + 1, question == uri.npos ? question : question - colon - 1),
                  question == uri.npos ? "" : uri.substr(question)};
    const bool turn = server.scheme == "turn" || server.scheme == "turns";
    const bool plain =
        server.query.empty() || (turn && (server.query == "?transport=udp" || server.query == "?transport=tcp"));
    if ((!turn && server.scheme != "stun") || !plain || !is_host(server.host))
      throw Error(
          "--ice-server " + uri +
          ": must have the form stun:HOST:PORT or turn:HOST:PORT, optionally with ?transport=udp or ?transport=tcp");
    if (turn && credentials.empty()) throw Error("--ice-server " + uri + ": a TURN server requires --ice-credentials");
    servers_.push_back(std::move(server));
  }
  std::istringstream words(credentials);
  std::string first, second, third;
  words >> first >> second >> third;
  if (!third.empty() || (!first.empty() && !is_word(first)) || (!second.empty() && !is_word(second)))
    throw Error(
        "--ice-credentials: the file must contain a user and a password, or a single secret, without quotation marks");
  if (second.empty())
    secret_ = first;
  else
    fixed_ = {first, second};
}

// The server of a shared secret expects the expiry time of the password as the user name.
IceServers::Credentials IceServers::credentials(int64_t now) const {
  if (secret_.empty()) return fixed_;
  const std::string user = std::to_string(now + kLifetime);
  return {user, hmac_sha1(secret_, user)};
}

std::string IceServers::links(int64_t now) const {
  const auto [user, password] = credentials(now);
  std::string links;
  for (const auto& [scheme, host, query] : servers_) {
    links += (links.empty() ? "<" : ", <") + scheme + ":" + host + query + ">; rel=\"ice-server\"";
    if (scheme != "stun")
      links += "; username=\"" + user + "\"; credential=\"" + password + "\"; credential-type=\"password\"";
  }
  return links;
}

std::set<std::string> IceServers::relays() const {
  std::set<std::string> addresses;
  for (const auto& [scheme, host, query] : servers_) {
    if (scheme == "stun") continue;
    g_autoptr(GError) error = nullptr;
    g_autoptr(GResolver) resolver = g_resolver_get_default();
    g_autoptr(GSocketConnectable) place = g_network_address_parse(host.c_str(), 3478, &error);
    GList* found = place ? g_resolver_lookup_by_name(resolver, g_network_address_get_hostname(G_NETWORK_ADDRESS(place)),
                                                     nullptr, &error)
                         : nullptr;
    if (error) say("--ice-server " + scheme + ":" + host + query + ": " + error->message);
    for (GList* address = found; address; address = address->next) {
      g_autofree gchar* text = g_inet_address_to_string(G_INET_ADDRESS(address->data));
      addresses.insert(text);
    }
    g_resolver_free_addresses(found);
  }
  return addresses;
}

std::vector<std::string> IceServers::for_webrtcbin(int64_t now) const {
  const auto [user, password] = credentials(now);
  std::vector<std::string> uris;
  for (const auto& [scheme, host, query] : servers_) {
    const std::string place = host + (has_port(host) ? "" : scheme == "turns" ? ":5349" : ":3478");
    uris.push_back(scheme == "stun" ? "stun://" + place
                                    : scheme + "://" + escaped(user) + ":" + escaped(password) + "@" + place + query);
  }
  return uris;
}

namespace {

std::string_view hash_name(std::string_view text) { return text.substr(0, text.find(' ')); }

std::optional<GChecksumType> hash_of(std::string_view text) {
  constexpr std::pair<std::string_view, GChecksumType> kHashes[] = {
      {"sha-256", G_CHECKSUM_SHA256}, {"sha-384", G_CHECKSUM_SHA384}, {"sha-512", G_CHECKSUM_SHA512}};
  const std::string_view name = hash_name(text);
  for (const auto& [known, type] : kHashes)
    if (name.size() == known.size() && g_ascii_strncasecmp(name.data(), known.data(), known.size()) == 0) return type;
  return std::nullopt;
}

std::optional<std::string> digits_of(std::string_view text) {
  std::string_view value = text.substr(std::min(text.size(), hash_name(text).size() + 1));
  std::string digits;
  for (size_t i = 0; i < value.size(); i++) {
    const auto c = static_cast<unsigned char>(value[i]);
    if (i % 3 == 2 ? c != ':' : !std::isxdigit(c)) return std::nullopt;
    if (i % 3 != 2) digits += static_cast<char>(std::tolower(c));
  }
  return digits;
}

std::string der_of(const std::string& pem) {
  constexpr std::string_view kBegin = "-----BEGIN CERTIFICATE-----", kEnd = "-----END CERTIFICATE-----";
  const size_t begin = pem.find(kBegin), end = pem.find(kEnd);
  if (begin == pem.npos || end == pem.npos || end < begin) return "";
  const std::string base64 = pem.substr(begin + kBegin.size(), end - begin - kBegin.size());
  gsize size = 0;
  g_autofree guchar* bytes = g_base64_decode(base64.c_str(), &size);
  return {reinterpret_cast<const char*>(bytes), size};
}

}  // namespace

FingerprintKind fingerprint_kind(std::string_view text) {
  const auto hash = hash_of(text);
  if (!hash) return hash_name(text).empty() ? FingerprintKind::kMalformed : FingerprintKind::kUnknownHash;
  const auto digits = digits_of(text);
  const auto size = static_cast<size_t>(2 * g_checksum_type_get_length(*hash));
  return digits && digits->size() == size ? FingerprintKind::kKnown : FingerprintKind::kMalformed;
}

bool has_fingerprint(const std::string& certificate_pem, const std::set<std::string>& fingerprints) {
  const std::string der = der_of(certificate_pem);
  return !der.empty() && std::ranges::any_of(fingerprints, [&](const std::string& fingerprint) {
    const auto hash = hash_of(fingerprint);
    if (!hash) return false;
    g_autofree gchar* digits =
        g_compute_checksum_for_data(*hash, reinterpret_cast<const guchar*>(der.data()), der.size());
    return digits_of(fingerprint) == std::string(digits);
  });
}

namespace {

constexpr char kMalformedFingerprint[] = "an a=fingerprint of the offer is malformed";
constexpr char kTooManyAttributes[] = "the offer has too many formats or attributes";

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

// True for constrained baseline: profile_idc 42 and constraint_set1_flag (RFC 6184, table 5).
bool is_constrained_baseline(const std::string& profile) {
  unsigned value = 0;
  const char* end = profile.data() + profile.size();
  if (profile.size() != 6 || std::from_chars(profile.data(), end, value, 16).ptr != end) return false;
  return value >> 16 == 0x42 && (value >> 8 & 0x40);
}

struct Format {
  std::string_view map, parameters;
};
constexpr size_t kPayloadTypes = 128;

// Removes the payload type from the front of an attribute's value ("PAYLOAD ..."). Returns std::nullopt if there is
// none.
std::optional<size_t> take_payload(std::string_view& value) {
  size_t number = 0;
  const char* end = std::from_chars(value.data(), value.data() + value.size(), number).ptr;
  const auto length = static_cast<size_t>(end - value.data());
  if (length == 0 || number >= kPayloadTypes || (length < value.size() && value[length] != ' ')) return std::nullopt;
  value.remove_prefix(std::min(value.size(), length + 1));
  return number;
}

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

// Selects the first format of the codec, in the order of the offer. GStreamer's payloaders support only payload types
// from 96.
bool find_codec(const GstSDPMedia* media, const std::array<Format, kPayloadTypes>& formats, VideoCodec codec,
                Offer& offer) {
  constexpr size_t kMinPayloadType = 96;
  std::bitset<kPayloadTypes> seen;
  for (guint i = 0; i < gst_sdp_media_formats_len(media); i++) {
    std::string_view text = gst_sdp_media_get_format(media, i);
    const auto number = take_payload(text);
    if (!number || !text.empty() || *number < kMinPayloadType || seen[*number]) continue;
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

// Returns the id of a header extension (RFC 8285) from "3 URI" or "3/recvonly URI".
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

// Sets the parameters of the outgoing H.264. The server may send any level up to the offered one (RFC 6184), but
// webrtcbin declines an offer with another level.
void set_parameters(const GstSDPMedia* media, guint payload_type, const std::string& profile) {
  GstSDPMedia* writable = const_cast<GstSDPMedia*>(media);
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

// True for a UDP candidate with one of the addresses, such as "candidate:1 1 udp 2122260223 192.0.2.1 50000 typ host".
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
  GstSDPMedia* writable = const_cast<GstSDPMedia*>(media);
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

// webrtcbin scans all attributes for each format and each attribute, which takes quadratic time. Large offers are
// rejected.
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

// True if all media share one transport (RFC 9143), which WHEP requires.
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

// Adds the fingerprints of a medium, or of the session if `media` is null. Returns false if one is malformed.
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
  // GStreamer's parser logs criticals if the text is not valid UTF-8.
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

void set_profile(GstSDPMessage* answer, const Offer& offer) {
  if (offer.codec != VideoCodec::kH264) return;
  for (guint i = 0; i < gst_sdp_message_medias_len(answer); i++)
    if (const GstSDPMedia* media = gst_sdp_message_get_media(answer, i);
        g_strcmp0(gst_sdp_media_get_media(media), "video") == 0)
      set_parameters(media, offer.payload_type, offer.profile);
}

}  // namespace lf::serve
