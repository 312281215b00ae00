// SPDX-License-Identifier: LGPL-2.1-or-later
#include "base/text.h"

#include <charconv>
#include <cstddef>
#include <optional>
#include <sstream>

namespace lf {
namespace {

bool is_digit(char c) { return c >= '0' && c <= '9'; }

std::string_view take_digits(std::string_view& text) {
  size_t end = 0;
  while (end < text.size() && is_digit(text[end])) end++;
  std::string_view digits = text.substr(0, end);
  text.remove_prefix(end);
  const size_t first = digits.find_first_not_of('0');
  digits.remove_prefix(first == std::string_view::npos ? digits.size() : first);
  return digits;
}

std::optional<int> parse_port(const std::string& text) {
  int port = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), port);
  if (error != std::errc() || end != text.data() + text.size() || port < 1 || port > 65535) return std::nullopt;
  return port;
}

// Removes the port after the last colon from `text`, or the whole text if there is no colon.
std::optional<int> cut_port(std::string& text) {
  const size_t colon = text.rfind(':');
  const auto port = parse_port(text.substr(colon == text.npos ? 0 : colon + 1));
  text.resize(colon == text.npos ? 0 : colon);
  return port;
}

// Removes and returns the text after the last colon (outside brackets), unless it is a port.
std::string cut_address(std::string& text) {
  const size_t bracket = text.ends_with(']') ? text.rfind('[') : text.npos;
  const size_t colon = text.rfind(':', bracket);
  if (colon == text.npos || (bracket == text.npos && parse_port(text.substr(colon + 1)))) return "";
  const std::string address = text.substr(colon + 1);
  text.resize(colon);
  return address;
}

std::string without_brackets(const std::string& host) {
  return host.size() > 2 && host.front() == '[' && host.back() == ']' ? host.substr(1, host.size() - 2) : host;
}

std::vector<std::string> split(const std::string& text) {
  std::vector<std::string> items;
  std::istringstream stream(text);
  for (std::string item; std::getline(stream, item, ',');) items.push_back(item);
  return items;
}

}  // namespace

bool natural_less(std::string_view a, std::string_view b) {
  std::string_view x = a, y = b;
  while (!x.empty() && !y.empty()) {
    if (is_digit(x[0]) && is_digit(y[0])) {
      const std::string_view m = take_digits(x), n = take_digits(y);
      if (m.size() != n.size()) return m.size() < n.size();
      if (m != n) return m < n;
    } else {
      if (x[0] != y[0]) return static_cast<unsigned char>(x[0]) < static_cast<unsigned char>(y[0]);
      x.remove_prefix(1);
      y.remove_prefix(1);
    }
  }
  if (x.empty() != y.empty()) return x.empty();
  return a < b;
}

std::vector<HostPort> parse_host_ports(const std::string& text) {
  std::vector<HostPort> places;
  for (const std::string& item : split(text)) {
    std::string host = item;
    const auto port = cut_port(host);
    if (!port || (host.empty() && item.front() == ':')) throw Error(item + ": must be PORT or HOST:PORT");
    places.push_back({without_brackets(host), *port});
  }
  return places;
}

std::vector<NodeAddress> parse_nodes(const std::string& text) {
  std::vector<NodeAddress> nodes;
  for (const std::string& item : split(text)) {
    std::string host = item;
    const auto here = cut_port(host);
    const std::string address = here ? cut_address(host) : "";
    const auto there = here ? cut_port(host) : std::nullopt;
    if (!here || !there || host.empty()) throw Error(item + ": must be HOST:PORT-THERE:[ADDRESS-HERE:]PORT-HERE");
    nodes.push_back({without_brackets(host), *there, without_brackets(address), *here});
  }
  return nodes;
}

}  // namespace lf
