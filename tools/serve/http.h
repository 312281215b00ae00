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

// A header of the request; null if there is none.
const char* header(SoupServerMessage* message, const char* name);
// Sets a header of the response.
void set_header(SoupServerMessage* message, const char* name, const std::string& value);
void respond(SoupServerMessage* message, guint status, const char* type, const std::string& body);
// Answers OPTIONS: what a page of another site may ask for.
void allow(SoupServerMessage* message, const char* methods);

// Why something is refused, as docs/web-interface.md has it.
struct Refusal {
  guint status;
  const char* reason;   // a name for programs, one of kReasons
  const char* title;    // a sentence for people
  int retry_after = 0;  // seconds; 0: never
};

namespace refusal {
inline constexpr Refusal kHeader{400, "header", "a header that may come once came twice"};
inline constexpr Refusal kHost{403, "host", "this server does not go by that name (--host)"};
inline constexpr Refusal kOrigin{403, "origin", "this origin may not watch (--origin)"};
inline constexpr Refusal kToken{401, "token", "the bearer token is missing or wrong"};
inline constexpr Refusal kTokenRate{429, "token-rate", "too many wrong tokens", 30};
inline constexpr Refusal kLength{411, "body", "the body has no length"};
inline constexpr Refusal kBody{413, "body", "the body is too long"};
inline constexpr Refusal kType{415, "type", "the offer must be application/sdp"};
inline constexpr Refusal kRate{429, "rate", "too many connects", 10};
inline constexpr Refusal kAddress{429, "address", "this address has all the views it may have", 5};
inline constexpr Refusal kFull{503, "full", "too many viewers", 1};
inline constexpr Refusal kFilming{503, "filming", "the scene is filmed for the first time", 1};
inline constexpr Refusal kStarting{503, "starting", "the cameras are being opened", 1};
inline constexpr Refusal kView{500, "view", "the server can't open a view: its log says why", 10};
inline constexpr Refusal kPath{404, "path", "there is no such path (--path)"};
}  // namespace refusal

// Call before a request's body is read. Returns why the request is refused: a header that decides who may ask came
// twice, or the body is longer than `most` bytes or has no length. Null if it is not; else the body is thrown away.
// Takes the header Range from the request: answers are whole.
const Refusal* refuse_early(SoupServerMessage* message, size_t most);
// Sets the headers that all responses have. `caching`: the value of Cache-Control.
void set_common_headers(SoupServerMessage* message, const char* caching);

// Answers with refusals, and counts them by their reason. On the main thread alone.
class Refusals {
 public:
  // `client`: for the log. `more`: members beside title, status and reason.
  void answer(SoupServerMessage* message, const std::string& client, const Refusal& refusal);
  void answer(SoupServerMessage* message, const std::string& client, const Refusal& refusal,
              const nlohmann::json& more);
  // How often each reason was given, in the format of Prometheus.
  std::string metrics() const;

 private:
  std::map<std::string, uint64_t> count_;
};

// The TCP connections of an HTTP server, with TLS if there is a certificate. Slow connections are closed: a client has
// kHandshake seconds for the TLS handshake, kRequest seconds for the whole request and kResponse seconds to take the
// response. At most kMost connections are open; choose_victim() says which one is closed for one more. At most
// kMostHandshakes handshakes run, and others wait: the next is of the subscriber with the fewest connections, and its
// latest. A handshake that has run for kSlice is closed when another waits. A subscriber gets
// kHandshakesPerSecond, as each costs the main thread some 10 ms. Main thread only.
class Connections {
 public:
  // kMostHandshakes: fewer than the 10 threads that GLib starts at once, so that none waits for a thread.
  static constexpr size_t kMost = 256, kMostHandshakes = 8;
  static constexpr double kHandshakesPerSecond = 20, kHandshakesAtOnce = 40;
  static constexpr int64_t kSlice = 300000;                                // microseconds
  static constexpr int64_t kHandshake = 5, kRequest = 10, kResponse = 30;  // seconds
  static constexpr size_t kFair = 16;  // connections that a subscriber may have without being the first to lose one
  static constexpr int64_t kIdle = 1000000;  // microseconds after which a connection without a byte is idle

  // Listens. Takes references to `server` and `certificate` (null: no TLS). Throws Error naming `address`.
  Connections(SoupServer* server, const std::string& address, int port, GTlsCertificate* certificate);
  ~Connections();
  Connections(const Connections&) = delete;

  // The certificate of new connections. Not null; the server must have been made with one.
  void set_certificate(GTlsCertificate* certificate);
  int port() const { return port_; }
  size_t size();
  uint64_t closed() const { return closed_; }  // connections closed because they were too slow or too many
  // Call when the whole request of this connection has arrived.
  void asked(SoupServerMessage* message);
  // Call when the request is refused before its body has arrived. libsoup reads a body to its end before it answers:
  // the connection is closed after kRefusedBody bytes of one that has no length, as it may have no end.
  void refused(SoupServerMessage* message);
  static constexpr size_t kRefusedBody = 1 << 20;

  enum class Progress { kNothing, kSome, kRequest };  // what the client has sent
  struct Standing {
    std::string subscriber;
    int64_t since;  // g_get_monotonic_time()
    Progress progress;
  };
  // Which of these connections is closed to make room; there must be one. A subscriber with more than kFair loses one
  // first. Then an idle connection goes, then one without a whole request, each time the oldest. So an honest client
  // gets as long as the flood takes to open kMost connections, however many addresses the flood comes from.
  static size_t choose_victim(const std::vector<Standing>& all, int64_t now);

 private:
  enum class Phase { kHandshake, kRequest, kResponse };
  struct Connection {
    GWeakRef connection;  // a GSocketConnection; libsoup owns it, and may release it in another thread
    std::string subscriber, remote;
    int64_t since;  // g_get_monotonic_time() when the phase began
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
  void forget_closed();
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
