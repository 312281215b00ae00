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
  constexpr auto kParts = std::to_array<std::string_view>(
      {"pass", "pwd", "secret", "token", "credential", "user-pw", "user-id", "proxy-pw", "proxy-id", "cookie"});
  constexpr auto kNames =
      std::to_array<std::string_view>({"pw", "key", "user", "username", "auth", "apikey", "sig", "signature", "login"});
  return std::ranges::any_of(kParts, [&](std::string_view part) { return lower.find(part) != lower.npos; }) ||
         std::ranges::find(kNames, lower) != kNames.end() || lower.ends_with("-key") || lower.ends_with("_key");
}

// Where the user info of a URI ends ("@" included), `begin` being behind "//"; `begin` if there is none.
size_t end_of_user_info(std::string_view text, size_t begin) {
  const size_t end = std::min(text.find_first_of(kEndOfUri, begin), text.size());
  const std::string_view rest = text.substr(begin, end - begin);
  const std::string_view authority = rest.substr(0, rest.find_first_of("/?#"));
  if (const size_t at = authority.rfind('@'); at != authority.npos) return begin + at + 1;
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
  for (size_t i = 0; i < text.size();) {
    if (text.substr(i, 3) == "://") {
      shown += "://";
      i = end_of_user_info(text, i + 3);
    } else if (is_name_character(text[i])) {
      size_t end = i;
      while (end < text.size() && is_name_character(text[end])) end++;
      const std::string_view name = text.substr(i, end - i);
      shown += name;
      const bool in_query = i > 0 && (text[i - 1] == '?' || text[i - 1] == '&' || text[i - 1] == ';');
      i = end;
      while (end < text.size() && text[end] == ' ') end++;
      if (end == text.size() || text[end] != '=' || !is_secret_name(name)) continue;
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
