// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <charconv>
#include <cstdarg>
#include <cstdio>
#include <string>

#include <locale.h>

namespace lf {

// While an object lives, its thread reads and writes numbers with a point. An application that we are a part of, such
// as gst-launch-1.0, may have chosen its user's locale, in which printf() writes a comma.
class NumbersWithPoint {
 public:
  NumbersWithPoint() : before_(uselocale(plain())) {}
  ~NumbersWithPoint() { uselocale(before_); }
  NumbersWithPoint(const NumbersWithPoint&) = delete;
  NumbersWithPoint& operator=(const NumbersWithPoint&) = delete;

 private:
  static locale_t plain() {
    static const locale_t locale = newlocale(LC_ALL_MASK, "C", locale_t{});
    return locale;
  }
  const locale_t before_;
};

// The shortest text that reads back as the same number: "0.1", "1e-09".
inline std::string number_text(double value) {
  char text[40];
  return {text, std::to_chars(text, text + sizeof(text), value).ptr};
}

// "640x480".
inline std::string size_text(int width, int height) { return std::to_string(width) + "x" + std::to_string(height); }

// What printf() prints in the C locale.
[[gnu::format(printf, 1, 2)]] inline std::string format_text(const char* format, ...) {
  const NumbersWithPoint numbers;
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
