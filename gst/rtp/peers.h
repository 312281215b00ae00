// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include <gio/gio.h>

namespace lf {

// Looks up a host name, or parses an address, and returns the numeric addresses. A lookup takes at most kLookupSeconds,
// so that state changes do not hang. Throws Error if the lookup fails. Thread-safe.
inline constexpr int kLookupSeconds = 2;
std::vector<std::string> addresses_of(const std::string& host);

// An IP address without a port, for comparisons. IPv4 addresses are mapped to IPv6 (::ffff:a.b.c.d).
using Address = std::array<uint8_t, 16>;
// Returns the IP address of a socket address, or nothing if the socket is of another kind.
std::optional<Address> address_of(GSocketAddress* socket);
bool is_loopback(const Address& address);
std::string to_text(const Address& address);

// The list of hosts that may send packets to a receiver without a key. If the list is empty, only programs on this
// machine may send: the first loopback address that sends a packet is accepted from then on.
class Peers {
 public:
  Peers() = default;
  // `text` is a comma-separated list of names, addresses and networks, for example
  // "viewer,10.0.0.7,[fd00::7],fd00::/64". Looks up the names. Throws Error if an item is invalid or unknown.
  explicit Peers(const std::string& text);

  bool admits(const Address& address);

 private:
  struct Range {
    Address first;
    unsigned bits;
  };
  void add(const std::string& item);

  std::vector<Range> ranges_;
  std::optional<Address> first_;
};

}  // namespace lf
