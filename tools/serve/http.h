// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstdint>
#include <list>
#include <map>
#include <string>
#include <vector>

#include <libsoup/soup.h>
#include <nlohmann/json_fwd.hpp>

#include "serve/limits.h"

namespace lf::serve {

const char* header(SoupServerMessage* message, const char* name);
void set_header(SoupServerMessage* message, const char* name, const std::string& value);
void respond(SoupServerMessage* message, guint status, const char* type, const std::string& body);
// Answers OPTIONS with the methods that pages of other sites may use.
void allow(SoupServerMessage* message, const char* methods);

// Reason for refusing a request, see docs/reference/web-interface.md.
struct HttpRefusal {
  guint status;
  const char* reason;  // machine-readable name, one of kReasons
  const char* title;
  int retry_after = 0;  // seconds; 0: never
};

namespace refusal {
inline constexpr HttpRefusal kHeader{400, "header", "a header must not be repeated"};
inline constexpr HttpRefusal kHost{403, "host", "unknown name of this server (--host)"};
inline constexpr HttpRefusal kOrigin{403, "origin", "this origin may not watch (--origin)"};
inline constexpr HttpRefusal kToken{401, "token", "the bearer token is missing or wrong"};
inline constexpr HttpRefusal kTokenRate{429, "token-rate", "too many wrong tokens", 30};
inline constexpr HttpRefusal kLength{411, "body", "the body has no length"};
inline constexpr HttpRefusal kBody{413, "body", "the body is too long"};
inline constexpr HttpRefusal kType{415, "type", "the offer must be application/sdp"};
inline constexpr HttpRefusal kRate{429, "rate", "too many connects", 10};
inline constexpr HttpRefusal kAddress{429, "address", "too many views from this address", 5};
inline constexpr HttpRefusal kFull{503, "full", "too many viewers", 1};
inline constexpr HttpRefusal kFilming{503, "filming", "the scene is filmed for the first time", 1};
inline constexpr HttpRefusal kStarting{503, "starting", "the cameras are being opened", 1};
inline constexpr HttpRefusal kView{500, "view", "the server can't open a view: its log says why", 10};
inline constexpr HttpRefusal kPath{404, "path", "no such path (--path)"};
}  // namespace refusal

// Call before a request's body is read. Returns the reason if the request is refused: a security-relevant header is
// duplicated, or the body has no length or is longer than `most` bytes. The body is then discarded. Returns null
// otherwise. Also removes the Range header, because responses are always complete.
const HttpRefusal* refuse_early(SoupServerMessage* message, size_t most);
// Sets the headers of all responses. `caching`: value of Cache-Control.
void set_common_headers(SoupServerMessage* message, const char* caching);

// Sends refusals and counts them by reason. Main thread only.
class Refusals {
 public:
  // `client`: for the log. `more`: members besides title, status and reason.
  void answer(SoupServerMessage* message, const std::string& client, const HttpRefusal& refusal);
  void answer(SoupServerMessage* message, const std::string& client, const HttpRefusal& refusal,
              const nlohmann::json& more);
  std::string metrics() const;

 private:
  std::map<std::string, uint64_t> count_;
};

// TCP connections of an HTTP server, with TLS if there is a certificate. Slow connections are closed: a client has
// kHandshake seconds for the TLS handshake, kRequest seconds for the whole request and kResponse seconds to read the
// response. At most kMost connections are open; choose_victim() selects a connection to close for the next. Main
// thread only.
//
// At most kMostHandshakes handshakes run at a time. The next one is the latest of the subscriber with the fewest
// connections. A handshake that has run for kHandshakeSlice is closed when another waits. A subscriber gets
// kHandshakesPerSecond, because each costs the main thread some 10 ms.
class Connections {
 public:
  // kMostHandshakes is less than GLib's 10 initial threads, so that no handshake waits for a thread.
  static constexpr size_t kMost = 256, kMostHandshakes = 8;
  static constexpr double kHandshakesPerSecond = 20, kHandshakesAtOnce = 40;
  static constexpr int64_t kHandshakeSlice = 300000;                       // microseconds
  static constexpr int64_t kHandshake = 5, kRequest = 10, kResponse = 30;  // seconds
  static constexpr size_t kFairShare = 16;   // connections of a subscriber that are not closed first
  static constexpr int64_t kIdle = 1000000;  // microseconds without data until a connection is idle

  // Listens on the address. Takes references to `server` and `certificate` (null: no TLS). Throws Error that names
  // `address`.
  Connections(SoupServer* server, const std::string& address, int port, GTlsCertificate* certificate);
  ~Connections();
  Connections(const Connections&) = delete;

  // Sets the certificate of new connections, not null. The constructor must have received a certificate, too.
  void set_certificate(GTlsCertificate* certificate);
  int port() const { return port_; }
  size_t size();
  uint64_t closed() const { return closed_; }
  // Call when the whole request of this connection has arrived.
  void asked(SoupServerMessage* message);
  // Call when a request is refused before its body has arrived. libsoup reads the body to the end before it responds. A
  // body without a length may be endless, so the connection is closed after kRefusedBody bytes.
  void refused(SoupServerMessage* message);
  static constexpr size_t kRefusedBody = 1 << 20;

  enum class Progress { kNothing, kSome, kRequest };
  struct ConnectionInfo {
    std::string subscriber;
    int64_t since;  // g_get_monotonic_time()
    Progress progress;
  };
  // Returns the connection to close; `all` must not be empty. First choice is a subscriber with more than kFairShare
  // connections, then an idle connection, then one without a whole request; each time the oldest. An honest client thus
  // has as long as a flood needs to open kMost connections, from however many addresses.
  static size_t choose_victim(const std::vector<ConnectionInfo>& all, int64_t now);

 private:
  enum class Phase { kHandshake, kRequest, kResponse };
  struct Connection {
    GWeakRef connection;  // a GSocketConnection owned by libsoup, which may release it in another thread
    std::string subscriber, remote;
    int64_t since;  // g_get_monotonic_time() at the start of the phase
    Phase phase;
    bool ended = false;
  };
  struct Handshake;

  void accept(GSocketConnection* connection);
  void await_hello(GSocketConnection* connection, Connection& state);
  void start_handshakes();
  bool start_handshake(Handshake* handshake);
  void finish_handshake(Handshake* handshake, bool done);
  void hand_over(GSocketConnection* connection, GIOStream* stream);
  void make_room();
  void end(Connection& state);
  void remove_closed();
  void tick();

  SoupServer* server_;
  GTlsCertificate* certificate_;
  GSocketService* service_;
  int port_ = 0;
  guint timer_ = 0, handshake_timer_ = 0;
  std::list<Connection> open_;
  std::list<Handshake*> handshakes_;  // until each has ended
  AddressLimit handshake_limit_{kHandshakesPerSecond, kHandshakesAtOnce};
  uint64_t closed_ = 0;
};

}  // namespace lf::serve
