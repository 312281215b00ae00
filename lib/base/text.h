// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <charconv>
#include <cstdarg>
#include <cstdio>
#include <string>
#include <string_view>
#include <vector>

#include <locale.h>

#include <lightfield/error.h>

namespace lf {

// Thrown by all functions that read or validate files and options. The text is meant for users and names the file and
// the place of the error, for example "rig.json: cameras[3].params[0]: must be finite". Network input never throws: the
// codecs in wire/ return a std::optional and a reason.
using lightfield::Error;

// Compares names in natural order, with runs of digits as numbers, so that "cam2" comes before "cam10". It is a strict
// weak order; names that differ only in leading zeros compare as plain text. Use it for all file and camera names.
bool natural_less(std::string_view a, std::string_view b);

// Selects the C locale for the current thread, so that numbers have a decimal point. Applications such as
// gst-launch-1.0 may set the user's locale, and printf() may then write a comma.
class ScopedCLocale {
 public:
  ScopedCLocale() : before_(uselocale(plain())) {}
  ~ScopedCLocale() { uselocale(before_); }
  ScopedCLocale(const ScopedCLocale&) = delete;
  ScopedCLocale& operator=(const ScopedCLocale&) = delete;

 private:
  static locale_t plain() {
    static const locale_t locale = newlocale(LC_ALL_MASK, "C", locale_t{});
    return locale;
  }
  const locale_t before_;
};

// Returns the shortest text that parses to the same number, such as "0.1" or "1e-09".
inline std::string number_text(double value) {
  char text[40];
  return {text, std::to_chars(text, text + sizeof(text), value).ptr};
}

inline std::string size_text(int width, int height) { return std::to_string(width) + "x" + std::to_string(height); }

// Does the same as printf(), in the C locale.
[[gnu::format(printf, 1, 2)]] inline std::string format_text(const char* format, ...) {
  const ScopedCLocale numbers;
  std::string text;
  for (int i = 0; i < 2; i++) {
    va_list arguments;
    va_start(arguments, format);
    const int length = std::vsnprintf(text.data(), i == 0 ? 0 : text.size() + 1, format, arguments);
    va_end(arguments);
    text.resize(length < 0 ? 0 : static_cast<size_t>(length));
  }
  return text;
}

struct HostPort {
  std::string host;  // name or address (IPv6 with or without brackets); may be empty
  int port = 0;      // UDP port, 1 to 65535
  bool operator==(const HostPort&) const = default;
};
// Parses comma-separated items "PORT" or "HOST:PORT". Returns no items for an empty text. Throws Error with the invalid
// item.
std::vector<HostPort> parse_host_ports(const std::string& text);

struct NodeAddress {
  std::string host;
  int request_port = 0;     // UDP port of the host for requests
  std::string answer_host;  // address of this machine for answers; empty: all addresses
  int answer_port = 0;      // UDP port of this machine for answers
  bool operator==(const NodeAddress&) const = default;
};
// Parses comma-separated items "HOST:PORT-THERE:[ADDRESS-HERE:]PORT-HERE". IPv6 addresses need brackets. Throws Error
// with the invalid item.
std::vector<NodeAddress> parse_nodes(const std::string& text);

}  // namespace lf
