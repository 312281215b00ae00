// SPDX-License-Identifier: LGPL-2.1-or-later
#include "rig/source_security.h"

#include <algorithm>
#include <array>
#include <cctype>
#include <cerrno>
#include <cstring>
#include <filesystem>
#include <string_view>
#include <vector>

#include <grp.h>
#include <pwd.h>
#include <sys/stat.h>
#include <unistd.h>

#include "base/file.h"
#include "base/text.h"

namespace lf {

namespace {

constexpr std::string_view kWord = "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789_-";

// Sources, converters, parsers, demuxers and decoders. No element here writes files, runs programs, opens another light
// field, or reads unrelated data (file descriptors, screens). Encoders are excluded, because some write statistics.
constexpr auto kTrustedElements = std::to_array<std::string_view>(
    {// Sources.
     "aravissrc", "decklinkvideosrc", "filesrc", "gltestsrc", "libcamerasrc", "nvarguscamerasrc", "nvv4l2camerasrc",
     "pylonsrc", "rpicamsrc", "rtmp2src", "rtspsrc", "souphttpsrc", "srtsrc", "tcpclientsrc", "udpsrc", "uvch264src",
     "v4l2src", "videotestsrc",
     // Flow and timing.
     "capsfilter", "clocksync", "identity", "imagefreeze", "queue", "typefind", "videorate",
     // Conversion of raw video.
     "aspectratiocrop", "bayer2rgb", "clockoverlay", "deinterlace", "gamma", "glcolorconvert", "glcolorscale",
     "gldownload", "glupload", "glvideoflip", "jpegenc", "nvvidconv", "nvvideoconvert", "textoverlay", "timeoverlay",
     "v4l2convert", "vaapipostproc", "vapostproc", "videobalance", "videobox", "videoconvert", "videoconvertscale",
     "videocrop", "videoflip", "videoscale",
     // RTP, demuxers and parsers.
     "av1parse", "avidemux", "decodebin", "decodebin3", "flvdemux", "h264parse", "h265parse", "jpegparse",
     "matroskademux", "mpeg4videoparse", "mpegvideoparse", "multipartdemux", "parsebin", "pngparse", "qtdemux",
     "rawvideoparse", "rtph264depay", "rtph265depay", "rtpjitterbuffer", "rtpjpegdepay", "rtpmp2tdepay", "rtpmp4vdepay",
     "rtpptdemux", "rtpvp8depay", "rtpvp9depay", "rtpvrawdepay", "tsdemux", "tsparse", "vp9parse",
     // Decoders.
     "av1dec", "avdec_h264", "avdec_h265", "avdec_mjpeg", "avdec_mpeg4", "dav1ddec", "jpegdec", "libde265dec",
     "nvh264dec", "nvh265dec", "nvjpegdec", "nvv4l2decoder", "openh264dec", "pngdec", "v4l2h264dec", "v4l2h265dec",
     "v4l2jpegdec", "vaapih264dec", "vaapih265dec", "vaapijpegdec", "vah264dec", "vah265dec", "vajpegdec", "vp8dec",
     "vp9dec"});

// URI schemes of cameras, streams and files. Other schemes reach elements that are not on the list above. GStreamer's
// imagesequence: and multifile: use their argument as a printf() format string.
constexpr auto kTrustedSchemes =
    std::to_array<std::string_view>({"file", "http", "https", "rtmp", "rtmps", "rtmpt", "rtp", "rtsp", "rtspt", "rtsps",
                                     "rtspu", "rtsph", "srt", "tcp", "udp", "v4l2"});

// Properties of the allowed elements that an untrusted rig must not set: requests that change data on a server, and
// files that decide which servers are trusted.
constexpr auto kUntrustedProperties = std::to_array<std::string_view>(
    {"method", "ssl-ca-file", "ssl-use-system-ca-file", "tls-database", "tls-interaction"});

// Parses a description like gst_parse_launch(), but accepts only a subset: elements with properties, and caps,
// separated by " ! ". Everything else (pad names, bins, backslashes) counts as untrusted, so that no text has two
// interpretations.
class DescriptionReader {
 public:
  explicit DescriptionReader(const std::string& text) : text_(text) {}

  std::optional<std::string> untrusted_component() {
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
  static std::string quoted(std::string_view text) {
    std::string out = "\"";
    out += text;
    return out += '"';
  }

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
    // The link after the caps must be a separate word.
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
    at_++;
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

bool is_launch_description(const std::string& source) {
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

bool is_launch_line(const Rig& rig, const std::string& source) {
  std::error_code error;
  return is_launch_description(source) && !std::filesystem::exists(rig.resolve(source), error);
}

std::optional<std::string> untrusted_component(const std::string& source) {
  if (is_launch_description(source)) return DescriptionReader(source).untrusted_component();
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

namespace {

// Debian creates a group for each user, with the user's name and no other members.
bool is_private_group(uid_t user, gid_t group) {
  constexpr size_t kMost = 16384;
  std::vector<char> user_text(kMost), group_text(kMost);
  passwd user_entry, *user_found = nullptr;
  ::group group_entry, *group_found = nullptr;
  if (getpwuid_r(user, &user_entry, user_text.data(), kMost, &user_found) != 0 || !user_found) return false;
  if (getgrgid_r(group, &group_entry, group_text.data(), kMost, &group_found) != 0 || !group_found) return false;
  return std::strcmp(user_entry.pw_name, group_entry.gr_name) == 0 && !group_entry.gr_mem[0];
}

void require_own_file(const std::string& path) {
  struct stat status;
  if (stat(path.c_str(), &status) != 0) throw Error(path + ": " + std::strerror(errno));
  const bool others_write =
      (status.st_mode & S_IWOTH) || ((status.st_mode & S_IWGRP) && !is_private_group(status.st_uid, status.st_gid));
  if ((status.st_uid == geteuid() || status.st_uid == 0) && !others_write) return;
  throw Error(
      path +
      " can be written by other users. They could make its sources run programs under your name, so a rig file with "
      "sources made of elements must belong to you: run chown and chmod go-w on it, or use a copy of your own");
}

}  // namespace

void require_trust(const Camera& camera, const std::string& path, bool trusted) {
  if (is_launch_description(camera.source) && !path.empty()) require_own_file(path);
  if (trusted) return;
  // An image is never a description, but may be a URI, and is used if there is no source.
  const bool is_image = camera.source.empty() && !is_launch_description(camera.image);
  if (const auto part = untrusted_component(is_image ? camera.image : camera.source))
    throw Error("its source has " + *part +
                ", which may write files or run programs. If you trust this rig file, allow it: --trust-rig, or the "
                "property trusted=true");
}

void require_trust(const Rig& rig, const std::string& path, bool trusted) {
  for (const Camera& camera : rig.cameras) {
    if (is_launch_description(camera.source) && !is_launch_line(rig, camera.source)) continue;  // a file's name
    try {
      require_trust(camera, path, trusted);
    } catch (const Error& error) {
      throw Error(path + ": " + camera.label() + ": " + error.what());
    }
  }
}

namespace {

constexpr std::string_view kHidden = "***";
constexpr std::string_view kEndOfUri = " \t\r\n\"'<>`";

bool is_name_character(char c) { return std::isalnum(static_cast<unsigned char>(c)) || c == '-' || c == '_'; }

bool is_secret_name(std::string_view name) {
  std::string lower(name);
  std::ranges::transform(lower, lower.begin(), [](unsigned char c) { return std::tolower(c); });
  constexpr auto kParts =
      std::to_array<std::string_view>({"pass", "pwd", "secret", "token", "credential", "user-pw", "user-id", "proxy-pw",
                                       "proxy-id", "cookie", "authoriz", "header"});
  constexpr auto kNames =
      std::to_array<std::string_view>({"pw", "key", "user", "username", "auth", "apikey", "sig", "signature", "login"});
  return std::ranges::any_of(kParts, [&](std::string_view part) { return lower.find(part) != lower.npos; }) ||
         std::ranges::find(kNames, lower) != kNames.end() || lower.ends_with("-key") || lower.ends_with("_key");
}

// True if a parameter in a URI's query may be displayed. Cameras use many names for passwords, so this is an
// allow-list.
bool is_shown_parameter(std::string_view name) {
  constexpr auto kNames =
      std::to_array<std::string_view>({"action", "camera", "channel", "codec", "fps", "framerate", "height", "latency",
                                       "mode", "resolution", "size", "stream", "subtype", "width"});
  return std::ranges::find(kNames, name) != kNames.end();
}

// Returns the end of "user:password@" at the start of a word without a scheme, or `begin` if there is none.
size_t end_of_bare_user_info(std::string_view text, size_t begin) {
  const size_t end = std::min(text.find_first_of(kEndOfUri, begin), text.size());
  const std::string_view word = text.substr(begin, end - begin);
  const size_t colon = word.find(':'), at = word.rfind('@');
  return colon != word.npos && at != word.npos && colon < at && word.find("://") == word.npos ? begin + at + 1 : begin;
}

// Returns the end of a URI's user info (after "@"), or `begin` if there is none. `begin`: just after "//".
size_t end_of_user_info(std::string_view text, size_t begin) {
  const size_t end = std::min(text.find_first_of(kEndOfUri, begin), text.size());
  const std::string_view rest = text.substr(begin, end - begin);
  const std::string_view authority = rest.substr(0, rest.find_first_of("/?#"));
  if (const size_t at = authority.rfind('@'); at != authority.npos) return begin + at + 1;
  // A user name may contain a space.
  const std::string_view line = text.substr(begin, text.find_first_of("/?#\t\r\n\"'<>`", begin) - begin);
  if (const size_t at = line.rfind('@'); end < begin + line.size() && at != line.npos && line.find(':') < at)
    return begin + at + 1;
  // A password may contain an unescaped "/". In that case the text after the colon is not a port.
  const size_t colon = authority.rfind(':'), at = rest.rfind('@');
  if (colon == authority.npos || at == rest.npos || authority.back() == ']') return begin;
  const std::string_view port = authority.substr(colon + 1);
  const bool is_port = !port.empty() && std::ranges::all_of(port, [](unsigned char c) { return std::isdigit(c); });
  return is_port ? begin : begin + at + 1;
}

// Returns the end of the value that starts at `begin`. In a URI's query, "&" ends the value as well.
size_t end_of_value(std::string_view text, size_t begin, bool in_query) {
  if (in_query) return std::min(text.find_first_of(" \t\r\n\"'<>`&#", begin), text.size());
  // GStreamer structures write the type before the value: password=(string)"a b".
  if (begin < text.size() && text[begin] == '(') {
    const size_t type = text.find(')', begin);
    if (type != text.npos) begin = type + 1;
  }
  const char quote = begin < text.size() ? text[begin] : ' ';
  if (quote != '"' && quote != '\'') {
    while (begin < text.size() && !std::isspace(static_cast<unsigned char>(text[begin])))
      begin += text[begin] == '\\' ? 2 : 1;
    return std::min(begin, text.size());
  }
  for (begin++; begin < text.size() && text[begin] != quote; begin++)
    if (text[begin] == '\\') begin++;
  return std::min(begin + 1, text.size());
}

}  // namespace

std::string redacted_location(const std::string& source) {
  const std::string_view text = source;
  std::string shown;
  // GStreamer's message includes the rejected value.
  constexpr std::string_view kNotSet = "could not set property", kTo = " to \"";
  for (size_t i = 0; i < text.size();) {
    if (i == 0 || kEndOfUri.find(text[i - 1]) != kEndOfUri.npos) i = end_of_bare_user_info(text, i);
    if (text.substr(i, 3) == "://") {
      const bool is_rtmp = shown.ends_with("rtmp") || shown.ends_with("rtmps") || shown.ends_with("rtmpt");
      shown += "://";
      i = end_of_user_info(text, i + 3);
      if (!is_rtmp) continue;  // the path of an RTMP URI contains the stream key
      const size_t path = std::min(text.find_first_of("/ \t\r\n\"'<>`", i), text.size());
      shown += text.substr(i, path - i);
      i = std::min(text.find_first_of(kEndOfUri, path), text.size());
      if (i > path) shown.append("/").append(kHidden);
    } else if (text.substr(i).starts_with(kNotSet) && text.find(kTo, i) != text.npos) {
      shown += text.substr(i, text.find(kTo, i) + kTo.size() - i);
      shown.append(kHidden).append("\"");
      i = text.size();
    } else if (is_name_character(text[i])) {
      size_t end = i;
      while (end < text.size() && is_name_character(text[end])) end++;
      const std::string_view name = text.substr(i, end - i);
      shown += name;
      const char before = i > 0 ? text[i - 1] : ' ';
      const bool is_parameter = before == '?' || before == '&', in_query = is_parameter || before == ';';
      i = end;
      while (end < text.size() && text[end] == ' ') end++;
      if (end == text.size() || text[end] != '=') continue;
      if (!is_secret_name(name) && (!is_parameter || is_shown_parameter(name))) continue;
      for (end++; end < text.size() && text[end] == ' ';) end++;
      shown += "=";
      shown += kHidden;
      i = end_of_value(text, end, in_query);
    } else {
      shown += text[i++];
    }
  }
  return shown;
}

bool has_secret(const Camera& camera) {
  return redacted_location(camera.source) != camera.source || redacted_location(camera.image) != camera.image;
}

std::string secret_warning(const Rig& rig, const std::string& path) {
  const auto camera = std::ranges::find_if(rig.cameras, has_secret);
  if (camera == rig.cameras.end()) return "";
  const std::string mode = exposed_mode(path);
  if (mode.empty()) return "";
  return "cameras[" + std::to_string(camera - rig.cameras.begin()) +
         "]: its source contains a password or key, and other users can read or change this file (mode " + mode +
         "): run chmod 600 " + path;
}

}  // namespace lf
