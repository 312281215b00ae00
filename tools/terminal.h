// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstdarg>
#include <cstdio>
#include <string>
#include <string_view>

#include "base/terminal_text.h"
#include "base/text.h"

// All output of programs goes through these functions, because names, paths and messages of cameras may contain
// escape sequences that control the terminal. lf-serve also logs with say() of serve/process.h.
namespace terminal {

inline void write(std::FILE* stream, std::string_view text) { std::fputs(lf::terminal_text(text).c_str(), stream); }

inline std::string format_arguments(const char* format, va_list arguments) {
  const lf::ScopedCLocale numbers;
  va_list copy;
  va_copy(copy, arguments);
  const int length = std::vsnprintf(nullptr, 0, format, copy);
  va_end(copy);
  std::string text(length < 0 ? 0 : static_cast<size_t>(length), '\0');
  std::vsnprintf(text.data(), text.size() + 1, format, arguments);
  return text;
}

// Do the same as printf(), to standard output and standard error.
[[gnu::format(printf, 1, 2)]] inline void print(const char* format, ...) {
  va_list arguments;
  va_start(arguments, format);
  write(stdout, format_arguments(format, arguments));
  va_end(arguments);
}
[[gnu::format(printf, 1, 2)]] inline void print_error(const char* format, ...) {
  va_list arguments;
  va_start(arguments, format);
  write(stderr, format_arguments(format, arguments));
  va_end(arguments);
}

}  // namespace terminal
