// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <charconv>
#include <cstdarg>
#include <cstdio>
#include <string>

namespace lf {

// The shortest text that reads back as the same number: "0.1", "1e-09".
inline std::string number_text(double value) {
  char text[40];
  return {text, std::to_chars(text, text + sizeof(text), value).ptr};
}

// "640x480".
inline std::string size_text(int width, int height) { return std::to_string(width) + "x" + std::to_string(height); }

// What printf would print.
[[gnu::format(printf, 1, 2)]] inline std::string format_text(const char* format, ...) {
  std::string text;
  for (int i = 0; i < 2; i++) {  // how long it is, then the text
    va_list arguments;
    va_start(arguments, format);
    const int length = std::vsnprintf(text.data(), i == 0 ? 0 : text.size() + 1, format, arguments);
    va_end(arguments);
    text.resize(length < 0 ? 0 : static_cast<size_t>(length));
  }
  return text;
}

}  // namespace lf
