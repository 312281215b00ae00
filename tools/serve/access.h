// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <set>
#include <string>
#include <string_view>

namespace lf::serve {

// Compares two texts in a time that depends neither on the position of the first difference nor on the length of
// `secret`, so that the time reveals nothing about the secret.
bool is_same_secret(std::string_view given, std::string_view secret);

bool is_loopback(const std::string& address);

// Converts an origin, the scheme and host of a web page, to the form that browsers send. For example,
// "https://Example.org:443/" becomes "https://example.org". "null" and "*" are kept. Throws Error if `text` is not an
// origin.
std::string normal_origin(const std::string& text);
// Converts a host name to lower case and removes a port. For example, "Example.org:8080" becomes "example.org". Throws
// Error if `text` is not a host name.
std::string normal_host(const std::string& text);

// Decides whether an HTTP request may use the server, by its headers: the token, and the web page that the request
// comes from. Immutable and therefore thread-safe.
class Access {
 public:
  // `token` is the token that clients must send; empty if they need none. `origins` are allowed in addition to the
  // server's own origin; "*" allows any. `hosts` are names of the server in addition to the machine's name and
  // "localhost". Throws Error that names an invalid origin or host.
  Access(std::string token, const std::set<std::string>& origins, const std::set<std::string>& hosts);

  bool has_token(const char* authorization) const;
  // Checks the header Host, which may be null. It must contain an IP address or a name of this server. This prevents
  // DNS rebinding, where the name of a hostile site resolves to the address of this server.
  bool allows_host(const char* host) const;
  // Checks the header Origin, which may be null. Pages of this server have the origin of `host`. If a proxy has
  // replaced `host`, they have the origin of a name of this server.
  bool allows_origin(const char* origin, const char* host) const;
  // Checks the header Sec-Fetch-Site, which may be null. If a page of another site uses <img>, <script> or a link,
  // browsers send no Origin, but mark the request as "cross-site" or "same-site" in this header.
  bool allows_site(const char* site, const char* origin, const char* host) const;
  bool requires_token() const { return !token_.empty(); }
  const std::set<std::string>& origins() const { return origins_; }

 private:
  std::string token_;
  std::set<std::string> origins_, names_, hosts_;
};

// Returns the canonical form of an IP address, or an empty text if `text` is not an address. An IPv4-mapped IPv6
// address becomes IPv4.
std::string plain_address(const std::string& address);

// Returns the IP addresses of a reverse proxy, which is given as an IP address or "localhost". Throws Error for other
// names.
std::set<std::string> proxy_addresses(const std::string& proxy);

bool is_local_address(const std::string& address);

// Returns the subscriber that an address belongs to, because limits apply per subscriber. For IPv4 (also IPv4-mapped
// IPv6), the subscriber is the address. For IPv6, it is the /64 network, such as "2001:db8:1:2::/64", because one
// customer usually owns all of its addresses. Returns an empty text for invalid addresses.
std::string subscriber(const std::string& address);

// Returns the client address of a request from `peer`. If `peer` is a trusted proxy, this is the last address in the
// header X-Forwarded-For (`forwarded`, which may be null). Earlier entries may be forged by clients and are ignored.
std::string client_address(const std::string& peer, const char* forwarded, const std::set<std::string>& proxies);

// Returns the path prefix in the header X-Forwarded-Prefix of a proxy, such as "/lightfield". Returns an empty text if
// there is no header or its value is not a plain path.
std::string path_prefix(const char* forwarded);

}  // namespace lf::serve
