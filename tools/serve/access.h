// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <set>
#include <string>
#include <string_view>

namespace lf::serve {

// In a time that tells nothing of where they differ, nor of the length of `secret`.
bool is_same_secret(std::string_view given, std::string_view secret);

// An address of this machine alone: "localhost", 127.0.0.0/8, ::1.
bool is_loopback(const std::string& address);

// Who may ask, by the headers of a request. Immutable; thread-safe.
class Access {
 public:
  // `token`: "" asks for none. `origins`: as browsers send them ("https://example.org"), beside the server's own; "*"
  // is any. `local`: the server listens on loopback alone, so that it has no other names (a page that has its own
  // name point here, DNS rebinding, is not the server's own page).
  Access(std::string token, std::set<std::string> origins, bool local);

  // `authorization`: the header, or null.
  bool has_token(const char* authorization) const;
  // `origin`: of the page that asks, or null if it is not a page; `host`: what the client takes the server for.
  bool allows_origin(const char* origin, const char* host) const;
  bool asks_for_token() const { return !token_.empty(); }

 private:
  std::string token_;
  std::set<std::string> origins_;
  bool local_;
};

}  // namespace lf::serve
