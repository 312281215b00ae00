// SPDX-License-Identifier: LGPL-2.1-or-later
#include "base/terminal_text.h"

#include <algorithm>
#include <cstddef>

namespace lf {
namespace {

// Returns the number of bytes of the UTF-8 character at the start of a text that is not empty, or 0 if it is invalid.
size_t character_length(std::string_view text) {
  const auto byte = [&](size_t i) { return static_cast<unsigned char>(text[i]); };
  const unsigned char first = byte(0);
  if (first < 0x80) return 1;
  const size_t length = first >= 0xf0 ? 4 : first >= 0xe0 ? 3 : 2;
  if (first < 0xc2 || first > 0xf4 || text.size() < length) return 0;
  for (size_t i = 1; i < length; i++)
    if ((byte(i) & 0xc0) != 0x80) return 0;
  // Overlong encodings are invalid.
  return (first == 0xe0 && byte(1) < 0xa0) || (first == 0xf0 && byte(1) < 0x90) ? 0 : length;
}

bool is_control(std::string_view character) {
  const auto first = static_cast<unsigned char>(character[0]);
  return first < ' ' || first == 0x7f ||
         (first == 0xc2 && character.size() == 2 && static_cast<unsigned char>(character[1]) < 0xa0);
}

}  // namespace

std::string terminal_text(std::string_view text) {
  std::string shown;
  shown.reserve(text.size());
  while (!text.empty()) {
    const size_t length = character_length(text);
    const std::string_view character = text.substr(0, std::max<size_t>(length, 1));
    const bool is_white = character == "\n" || character == "\t";
    shown += length == 0 || (is_control(character) && !is_white) ? "?" : character;
    text.remove_prefix(character.size());
  }
  return shown;
}

bool has_control_characters(std::string_view text) {
  while (!text.empty()) {
    const std::string_view character = text.substr(0, std::max<size_t>(character_length(text), 1));
    if (is_control(character)) return true;
    text.remove_prefix(character.size());
  }
  return false;
}

}  // namespace lf
