// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstdint>
#include <set>
#include <string>
#include <vector>

namespace lf::serve {

// STUN and TURN servers (RFC 7064, RFC 7065) for viewers and for us. Immutable; thread-safe.
class IceServers {
 public:
  static constexpr int64_t kLifetime = 12 * 3600;  // seconds that credentials made of a secret are good for

  IceServers() = default;
  // `uris`: "stun:HOST", "turn:HOST:PORT?transport=udp", "turns:HOST", ... `credentials`: for TURN, either "USER
  // PASSWORD" or one word, the secret that is shared with the server, of which credentials are made that end (coturn:
  // use-auth-secret, static-auth-secret). Throws Error.
  IceServers(const std::vector<std::string>& uris, const std::string& credentials);

  bool empty() const { return servers_.empty(); }
  // The value of a Link header (RFC 9725, 4.6); `now`: seconds since 1970.
  std::string links(int64_t now) const;
  // The servers as webrtcbin takes them: "stun://HOST:PORT", "turn://USER:PASSWORD@HOST:PORT?transport=udp".
  std::vector<std::string> for_webrtcbin(int64_t now) const;
  // Addresses of the TURN servers, as text: packets that they pass on come from there. Blocks while names are looked
  // up; who is not found is said in the log.
  std::set<std::string> relays() const;

 private:
  struct Server {
    std::string scheme, host, query;  // "turn", "example.org:3478", "?transport=udp"
  };
  struct Credentials {
    std::string user, password;
  };
  Credentials credentials(int64_t now) const;

  std::vector<Server> servers_;
  Credentials fixed_;
  std::string secret_;
};

}  // namespace lf::serve
