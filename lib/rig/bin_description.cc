// SPDX-License-Identifier: LGPL-2.1-or-later
#include "rig/bin_description.h"

#include <algorithm>
#include <array>
#include <cctype>
#include <filesystem>
#include <string_view>
#include <vector>

#include "rig/rig.h"

namespace lf {
namespace {

constexpr std::string_view kWord = "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789_-";

// Sources, converters, parsers, demuxers and decoders. None writes a file, runs a program, opens another light field,
// or reads what is not meant for it (file descriptors, screens). Encoders are left out, as some write statistics.
constexpr auto kTrustedElements = std::to_array<std::string_view>({
    // Sources.
    "aravissrc",
    "decklinkvideosrc",
    "filesrc",
    "gltestsrc",
    "libcamerasrc",
    "nvarguscamerasrc",
    "nvv4l2camerasrc",
    "pylonsrc",
    "rpicamsrc",
    "rtmp2src",
    "rtspsrc",
    "souphttpsrc",
    "srtsrc",
    "tcpclientsrc",
    "udpsrc",
    "uvch264src",
    "v4l2src",
    "videotestsrc",
    // Flow and timing.
    "capsfilter",
    "clocksync",
    "identity",
    "imagefreeze",
    "queue",
    "typefind",
    "videorate",
    // Conversion of raw video.
    "aspectratiocrop",
    "bayer2rgb",
    "clockoverlay",
    "deinterlace",
    "gamma",
    "glcolorconvert",
    "glcolorscale",
    "gldownload",
    "glupload",
    "glvideoflip",
    "jpegenc",
    "nvvidconv",
    "nvvideoconvert",
    "textoverlay",
    "timeoverlay",
    "v4l2convert",
    "vaapipostproc",
    "vapostproc",
    "videobalance",
    "videobox",
    "videoconvert",
    "videoconvertscale",
    "videocrop",
    "videoflip",
    "videoscale",
    // RTP, demuxers and parsers.
    "av1parse",
    "avidemux",
    "decodebin",
    "decodebin3",
    "flvdemux",
    "h264parse",
    "h265parse",
    "jpegparse",
    "matroskademux",
    "mpeg4videoparse",
    "mpegvideoparse",
    "multipartdemux",
    "parsebin",
    "pngparse",
    "qtdemux",
    "rawvideoparse",
    "rtph264depay",
    "rtph265depay",
    "rtpjitterbuffer",
    "rtpjpegdepay",
    "rtpmp2tdepay",
    "rtpmp4vdepay",
    "rtpptdemux",
    "rtpvp8depay",
    "rtpvp9depay",
    "rtpvrawdepay",
    "tsdemux",
    "tsparse",
    "vp9parse",
    // Decoders.
    "av1dec",
    "avdec_h264",
    "avdec_h265",
    "avdec_mjpeg",
    "avdec_mpeg4",
    "dav1ddec",
    "jpegdec",
    "libde265dec",
    "nvh264dec",
    "nvh265dec",
    "nvjpegdec",
    "nvv4l2decoder",
    "openh264dec",
    "pngdec",
    "v4l2h264dec",
    "v4l2h265dec",
    "v4l2jpegdec",
    "vaapih264dec",
    "vaapih265dec",
    "vaapijpegdec",
    "vah264dec",
    "vah265dec",
    "vajpegdec",
    "vp8dec",
    "vp9dec",
});

// Schemes of URIs: cameras, streams and files. Others reach elements that are not on the list above, and GStreamer's
// imagesequence: and multifile: use what they are given as a format string of printf().
constexpr auto kTrustedSchemes =
    std::to_array<std::string_view>({"file", "http", "https", "rtmp", "rtmps", "rtmpt", "rtp", "rtsp", "rtspt", "rtsps",
                                     "rtspu", "rtsph", "srt", "tcp", "udp", "v4l2"});

// Properties of these elements that a stranger must not set: requests that change something at a server, and files that
// decide which server is believed.
constexpr auto kUntrustedProperties = std::to_array<std::string_view>(
    {"method", "ssl-ca-file", "ssl-use-system-ca-file", "tls-database", "tls-interaction"});

// Reads a description as gst_parse_launch() does, but knows a part of its language only: elements with properties, and
// caps, with " ! " between them. Whatever else there is (names of pads, bins, back-slashes) counts as untrusted, so
// that nothing here can be read in two ways.
class DescriptionReader {
 public:
  explicit DescriptionReader(const std::string& text) : text_(text) {}

  std::optional<std::string> untrusted_part() {
    bool is_first = true;
    do {
      skip_spaces();
      if (auto part = !is_first && is_caps() ? untrusted_caps() : untrusted_element()) return part;
      is_first = false;
    } while (take_link());
    return at_ < text_.size() ? std::optional(quoted(rest_word())) : std::nullopt;
  }

 private:
  static bool is_space(char c) { return std::isspace(static_cast<unsigned char>(c)); }
  static std::string quoted(std::string_view text) { return "\"" + std::string(text) + "\""; }

  void skip_spaces() {
    while (at_ < text_.size() && is_space(text_[at_])) at_++;
  }
  bool at_end_of_word() const { return at_ == text_.size() || is_space(text_[at_]); }
  std::string_view take(std::string_view characters) {
    const size_t begin = at_;
    at_ = std::min(text_.find_first_not_of(characters, at_), text_.size());
    return text_.substr(begin, at_ - begin);
  }
  std::string_view rest_word() const {
    size_t end = at_;
    while (end < text_.size() && !is_space(text_[end])) end++;
    return text_.substr(at_, end - at_);
  }
  bool take_link() {
    skip_spaces();
    if (rest_word() != "!") return false;
    at_++;
    return true;
  }

  // "video/x-raw,width=640"
  bool is_caps() const {
    const size_t slash = text_.find_first_not_of(kWord, at_);
    return slash != at_ && slash != std::string_view::npos && text_[slash] == '/';
  }
  std::optional<std::string> untrusted_caps() {
    const size_t begin = at_, end = std::min(text_.find('!', at_), text_.size());
    for (; at_ < end; at_++)
      if (text_[at_] == ';' || text_[at_] == '\\') return quoted(text_.substr(begin, end - begin));
    // The link after the caps must be a word of its own.
    if (end < text_.size() && !is_space(text_[end - 1])) return quoted(text_.substr(begin, end + 1 - begin));
    return std::nullopt;
  }

  std::optional<std::string> untrusted_element() {
    const std::string_view word = rest_word(), name = take(kWord);
    if (!at_end_of_word() || name.empty()) return quoted(word);
    if (std::ranges::find(kTrustedElements, name) == kTrustedElements.end()) return std::string(name);
    for (;;) {
      skip_spaces();
      if (at_ == text_.size() || rest_word() == "!") return std::nullopt;
      const std::string_view assignment = rest_word(), property = take(kWord);
      skip_spaces();
      if (property.empty() || at_ == text_.size() || text_[at_] != '=' || !take_value()) return quoted(assignment);
      if (std::ranges::find(kUntrustedProperties, property) != kUntrustedProperties.end())
        return std::string(property) + " of " + std::string(name);
    }
  }
  bool take_value() {
    at_++;  // the equals sign
    skip_spaces();
    if (at_ == text_.size()) return false;
    if (const char quote = text_[at_]; quote == '"' || quote == '\'') {
      const size_t end = text_.find(quote, at_ + 1);
      if (end == std::string_view::npos) return false;
      if (text_.substr(at_, end - at_).find('\\') != std::string_view::npos) return false;
      at_ = end + 1;
      return at_end_of_word();
    }
    const std::string_view value = rest_word();
    if (value.find_first_of("\"'\\!") != std::string_view::npos) return false;
    at_ += value.size();
    return true;
  }

  std::string_view text_;
  size_t at_ = 0;
};

}  // namespace

bool is_bin_description(const std::string& source) {
  if (is_uri(source)) return false;
  if (source.find(" ! ") != std::string::npos) return true;
  const size_t begin = source.find_first_not_of(' ');
  if (begin == std::string::npos) return false;
  const size_t space = source.find_first_not_of(kWord, begin);
  if (space == begin || space == std::string::npos || source[space] != ' ') return false;
  const size_t property = source.find_first_not_of(' ', space);
  if (property == std::string::npos) return false;
  size_t equals = source.find_first_not_of(kWord, property);
  if (equals == property || equals == std::string::npos) return false;
  equals = source.find_first_not_of(' ', equals);
  return equals != std::string::npos && source[equals] == '=';
}

bool describes_elements(const Rig& rig, const std::string& source) {
  std::error_code error;
  return is_bin_description(source) && !std::filesystem::exists(rig.resolve(source), error);
}

std::optional<std::string> untrusted_part(const std::string& source) {
  if (is_bin_description(source)) return DescriptionReader(source).untrusted_part();
  const size_t colon = source.find(':');
  if (colon == std::string::npos) return std::nullopt;
  std::string scheme = source.substr(0, colon);
  std::ranges::transform(scheme, scheme.begin(), [](unsigned char c) { return std::tolower(c); });
  if (scheme == "lf") return "a URI of another light field";
  if (!is_uri(source) || std::ranges::find(kTrustedSchemes, scheme) != kTrustedSchemes.end()) return std::nullopt;
  return "a URI of the scheme " + scheme;
}

bool is_trusted_element(const std::string& name) {
  return std::ranges::find(kTrustedElements, name) != kTrustedElements.end();
}

}  // namespace lf
