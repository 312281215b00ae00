// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <set>
#include <string>
#include <string_view>

namespace lf::serve {

// Compares in a time that depends neither on the first difference nor on the length of `secret`.
bool is_same_secret(std::string_view given, std::string_view secret);

// Whether the address belongs to this machine alone: "localhost", 127.0.0.0/8, ::1.
bool is_loopback(const std::string& address);

// An origin as browsers send it: "https://Example.org:443/" becomes "https://example.org". "null" and "*" stay. Throws
// Error if `text` is not an origin.
std::string normal_origin(const std::string& text);
// A host name without case and port: "Example.org:8080" becomes "example.org". Throws Error if `text` is not a name.
std::string normal_host(const std::string& text);

// Decides who may ask, by the headers of a request. Immutable; thread-safe.
class Access {
 public:
  // `token`: "" if clients need none. `origins`: allowed in addition to the server's own; "*" allows any. `hosts`:
  // names of the server in addition to the machine's own and "localhost". Throws Error naming a wrong origin or host.
  Access(std::string token, const std::set<std::string>& origins, const std::set<std::string>& hosts);

  // `authorization`: the header, or null.
  bool has_token(const char* authorization) const;
  // `host`: the header, or null. Addresses and the server's names are allowed. A page whose own name points here (DNS
  // rebinding) has another name in this header.
  bool allows_host(const char* host) const;
  // `origin`: the header, or null. The server's own pages have the origin of `host`, or of a name of the server if a
  // proxy replaces `host`.
  bool allows_origin(const char* origin, const char* host) const;
  // `site`: the header Sec-Fetch-Site, or null. Browsers send no Origin for <img>, <script> or a link in a page of
  // another site, but tell that the request is one ("cross-site", "same-site").
  bool allows_site(const char* site, const char* origin, const char* host) const;
  bool asks_for_token() const { return !token_.empty(); }
  const std::set<std::string>& origins() const { return origins_; }

 private:
  std::string token_;
  std::set<std::string> origins_, names_, hosts_;  // names_: as given; hosts_: and those of the machine
};

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
