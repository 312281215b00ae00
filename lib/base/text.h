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

// Thrown by everything that reads or validates a file or a user's option. The text names the file and the place
// inside it ("rig.json: cameras[3].params[0]: must be finite") and is fit to be shown to a person as it is.
// What comes off a network never throws: the codecs in wire/ return a std::optional and a reason.
using lightfield::Error;

// Whether `a` comes before `b` when runs of digits compare as numbers: "cam2" before "cam10". A strict weak order;
// names that differ only in leading zeros compare as plain text. Use for file and camera names everywhere.
bool natural_less(std::string_view a, std::string_view b);

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

// A host and a UDP port, as properties and options name them.
struct HostPort {
  std::string host;  // name or address, an IPv6 one with or without brackets; may be empty
  int port = 0;      // 1 to 65535
  bool operator==(const HostPort&) const = default;
};
// Parses items "PORT" or "HOST:PORT" with commas between them; an empty text has none. Throws Error that names the item
// that is neither.
std::vector<HostPort> parse_host_ports(const std::string& text);

// A host with cameras, and the ports by which its requests and answers go.
struct NodeAddress {
  std::string host;
  int request_port = 0;     // port of that host for requests
  std::string answer_host;  // address of this machine that answers come in at; may be empty: all of them
  int answer_port = 0;      // port of this machine for answers
  bool operator==(const NodeAddress&) const = default;
};
// Parses "HOST:PORT-THERE:[ADDRESS-HERE:]PORT-HERE,...", an address of IPv6 with brackets. Throws Error that names the
// item that is none.
std::vector<NodeAddress> parse_nodes(const std::string& text);

}  // namespace lf
