// SPDX-License-Identifier: LGPL-2.1-or-later
#include "rig/location_text.h"

#include <algorithm>
#include <array>
#include <cctype>
#include <string_view>

namespace lf {
namespace {

constexpr std::string_view kHidden = "***";
constexpr std::string_view kEndOfUri = " \t\r\n\"'<>`";

bool is_name_character(char c) { return std::isalnum(static_cast<unsigned char>(c)) || c == '-' || c == '_'; }

// Whether a value of this name is to be hidden.
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

// Whether a parameter of a URI's query may be shown. Cameras have many names for passwords.
bool is_shown_parameter(std::string_view name) {
  constexpr auto kNames =
      std::to_array<std::string_view>({"action", "camera", "channel", "codec", "fps", "framerate", "height", "latency",
                                       "mode", "resolution", "size", "stream", "subtype", "width"});
  return std::ranges::find(kNames, name) != kNames.end();
}

// The end of "user:password@" at the beginning of a word that lacks the scheme in front; `begin` if there is none.
size_t end_of_bare_user_info(std::string_view text, size_t begin) {
  const size_t end = std::min(text.find_first_of(kEndOfUri, begin), text.size());
  const std::string_view word = text.substr(begin, end - begin);
  const size_t colon = word.find(':'), at = word.rfind('@');
  return colon != word.npos && at != word.npos && colon < at && word.find("://") == word.npos ? begin + at + 1 : begin;
}

// Where the user info of a URI ends ("@" included), `begin` being behind "//"; `begin` if there is none.
size_t end_of_user_info(std::string_view text, size_t begin) {
  const size_t end = std::min(text.find_first_of(kEndOfUri, begin), text.size());
  const std::string_view rest = text.substr(begin, end - begin);
  const std::string_view authority = rest.substr(0, rest.find_first_of("/?#"));
  if (const size_t at = authority.rfind('@'); at != authority.npos) return begin + at + 1;
  // A user name may have a space.
  const std::string_view line = text.substr(begin, text.find_first_of("/?#\t\r\n\"'<>`", begin) - begin);
  if (const size_t at = line.rfind('@'); end < begin + line.size() && at != line.npos && line.find(':') < at)
    return begin + at + 1;
  // A password may have a "/" that is not escaped: then what follows the colon is no port.
  const size_t colon = authority.rfind(':'), at = rest.rfind('@');
  if (colon == authority.npos || at == rest.npos || authority.back() == ']') return begin;
  const std::string_view port = authority.substr(colon + 1);
  const bool is_port = !port.empty() && std::ranges::all_of(port, [](unsigned char c) { return std::isdigit(c); });
  return is_port ? begin : begin + at + 1;
}

// The end of the value that begins at `begin`. In the query of a URI it ends at an "&", too.
size_t end_of_value(std::string_view text, size_t begin, bool in_query) {
  if (in_query) return std::min(text.find_first_of(" \t\r\n\"'<>`&#", begin), text.size());
  // Texts of GStreamer's structures name the type in front: password=(string)"a b".
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

std::string location_text(const std::string& source) {
  const std::string_view text = source;
  std::string shown;
  // GStreamer names the value that it can't set.
  constexpr std::string_view kNotSet = "could not set property", kTo = " to \"";
  for (size_t i = 0; i < text.size();) {
    if (i == 0 || kEndOfUri.find(text[i - 1]) != kEndOfUri.npos) i = end_of_bare_user_info(text, i);
    if (text.substr(i, 3) == "://") {
      const bool is_rtmp = shown.ends_with("rtmp") || shown.ends_with("rtmps") || shown.ends_with("rtmpt");
      shown += "://";
      i = end_of_user_info(text, i + 3);
      if (!is_rtmp) continue;  // else the path has the key of the stream
      const size_t path = std::min(text.find_first_of("/ \t\r\n\"'<>`", i), text.size());
      shown += text.substr(i, path - i);
      i = std::min(text.find_first_of(kEndOfUri, path), text.size());
      if (i > path) shown += "/" + std::string(kHidden);
    } else if (text.substr(i).starts_with(kNotSet) && text.find(kTo, i) != text.npos) {
      shown += text.substr(i, text.find(kTo, i) + kTo.size() - i);
      shown += std::string(kHidden) + "\"";
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

}  // namespace lf
