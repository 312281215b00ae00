// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include <gio/gio.h>

namespace lf {

// The addresses of a host, as numbers; an address is its own. Asks the network about a name, for kLookupSeconds at
// most, so that a change of state does not hang where nobody answers. Throws Error where nobody knows the name. Any
// thread.
inline constexpr int kLookupSeconds = 2;
std::vector<std::string> addresses_of(const std::string& host);

// An address without a port; those of IPv4 as IPv6 has them, ::ffff:a.b.c.d.
using Address = std::array<uint8_t, 16>;
// Nothing for what is no address of IP.
std::optional<Address> address_of(GSocketAddress* socket);
bool is_loopback(const Address& address);
std::string to_text(const Address& address);

// Who may send packets: the addresses that are named, or, where none are, the first address of this machine that sends.
class Peers {
 public:
  Peers() = default;
  // Names, addresses and networks with commas between ("viewer,10.0.0.7,[fd00::7],fd00::/64"); nobody from "". Asks the
  // network about names. Throws Error about what is neither or is not known.
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
