// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <string>
#include <vector>

// Lists of hosts and UDP ports, as properties and options name them.
namespace lf {

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
