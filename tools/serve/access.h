// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <set>
#include <string>
#include <string_view>

namespace lf::serve {

// Whether both are the same, told in a time that depends neither on where they differ nor on the length of `secret`.
bool is_same_secret(std::string_view given, std::string_view secret);

// Whether it is an address of this machine alone: "localhost", 127.0.0.0/8, ::1.
bool is_loopback(const std::string& address);

// Decides who may ask, by the headers of a request. Immutable; thread-safe.
class Access {
 public:
  // `token`: "" asks for none. `origins`: as browsers send them ("https://example.org"), beside the server's own; "*"
  // is any. `hosts`: names that the server goes by, beside the machine's own and "localhost".
  Access(std::string token, std::set<std::string> origins, std::set<std::string> hosts);

  // `authorization`: the header, or null.
  bool has_token(const char* authorization) const;
  // `host`: what the client takes the server for, an address or one of the names. A page that has its own name point
  // here (DNS rebinding) has another name, which its browser tells.
  bool allows_host(const char* host) const;
  // `origin`: of the page that asks, or null if it is not a page. The server's own pages are those of `host`, and of
  // its names where a proxy says another one.
  bool allows_origin(const char* origin, const char* host) const;
  bool asks_for_token() const { return !token_.empty(); }

 private:
  std::string token_;
  std::set<std::string> origins_, names_, hosts_;  // names_: as they were given; hosts_: with those of the machine
};

}  // namespace lf::serve
