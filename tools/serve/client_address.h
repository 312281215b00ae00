// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <set>
#include <string>

namespace lf::serve {

// An address as text in one form: an IPv6 address that stands for an IPv4 one becomes that. "" for what is no address.
std::string plain_address(const std::string& address);

// The addresses of `proxy`, an IP address or "localhost". Throws Error for another name.
std::set<std::string> proxy_addresses(const std::string& proxy);

// Whether this machine has the IP address.
bool is_local_address(const std::string& address);

// The subscriber whom limits are for: an IPv4 address (IPv6 ones that stand for one, too), or the /64 of an IPv6
// address, which is what one customer has, as "2001:db8:1:2::/64". "" for what is no address.
std::string subscriber(const std::string& address);

// The address that a request comes from, as text: `peer`, or where that is one of `proxies` the one that it names last
// in X-Forwarded-For (`forwarded`, or null). What clients themselves write there is never believed.
std::string client_address(const std::string& peer, const char* forwarded, const std::set<std::string>& proxies);

// X-Forwarded-Prefix of a proxy, as a path to be put before ours: "/lightfield". "" where there is none or it is no
// plain path.
std::string path_prefix(const char* forwarded);

}  // namespace lf::serve
