// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstdarg>
#include <cstdio>
#include <string>

// What printf() would print; at most 127 characters.
[[gnu::format(printf, 1, 2)]] inline std::string text_of(const char* format, ...) {
  char text[128];
  va_list values;
  va_start(values, format);
  std::vsnprintf(text, sizeof text, format, values);
  va_end(values);
  return text;
}
