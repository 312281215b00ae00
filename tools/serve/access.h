// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <set>
#include <string>
#include <string_view>

namespace lf::serve {

// Compares in constant time: the duration depends neither on the first difference nor on the length of `secret`.
bool is_same_secret(std::string_view given, std::string_view secret);

// True for "localhost", 127.0.0.0/8 and ::1.
bool is_loopback(const std::string& address);

// Normalizes an origin as sent by browsers: "https://Example.org:443/" becomes "https://example.org". "null" and "*"
// are kept. Throws Error if `text` is not an origin.
std::string normal_origin(const std::string& text);
// Normalizes a host name, without port: "Example.org:8080" becomes "example.org". Throws Error if `text` is not a host
// name.
std::string normal_host(const std::string& text);

class Access {
 public:
  // `token`: "" if clients need no token. `origins`: allowed in addition to the server's own origin; "*" allows any.
  // `hosts`: names of the server in addition to the machine's name and "localhost". Throws Error that names an invalid
  // origin or host.
  Access(std::string token, const std::set<std::string>& origins, const std::set<std::string>& hosts);

  // `authorization`: the header, or null.
  bool has_token(const char* authorization) const;
  // `host`: the header, or null. IP addresses and the server's names are allowed. This blocks DNS rebinding, where a
  // foreign name resolves to this server.
  bool allows_host(const char* host) const;
  // `origin`: the header, or null. The server's own pages have the origin of `host`, or of a server name if a proxy
  // replaces `host`.
  bool allows_origin(const char* origin, const char* host) const;
  // `site`: the header Sec-Fetch-Site, or null. For <img>, <script> and links in pages of other sites, browsers send no
  // Origin, but mark the request as "cross-site" or "same-site".
  bool allows_site(const char* site, const char* origin, const char* host) const;
  bool requires_token() const { return !token_.empty(); }
  const std::set<std::string>& origins() const { return origins_; }

 private:
  std::string token_;
  std::set<std::string> origins_, names_, hosts_;  // names_: as given; hosts_: including the names of the machine
};

// Returns the canonical text of an IP address; an IPv4-mapped IPv6 address becomes IPv4. "": not an address.
std::string plain_address(const std::string& address);

// Returns the addresses of `proxy`, an IP address or "localhost". Throws Error for other names.
std::set<std::string> proxy_addresses(const std::string& proxy);

// True if the IP address belongs to this machine.
bool is_local_address(const std::string& address);

// Returns the subscriber to which limits apply: an IPv4 address (also for IPv4-mapped IPv6), or the /64 network of an
// IPv6 address, which one customer owns, as "2001:db8:1:2::/64". "": not an address.
std::string subscriber(const std::string& address);

// Returns the client address of a request: `peer`, or the last address in X-Forwarded-For (`forwarded`, or null) if
// `peer` is one of `proxies`. Entries written by clients are never trusted.
std::string client_address(const std::string& peer, const char* forwarded, const std::set<std::string>& proxies);

// Returns the path prefix in a proxy's X-Forwarded-Prefix: "/lightfield". "": no header, or not a plain path.
std::string path_prefix(const char* forwarded);

}  // namespace lf::serve
