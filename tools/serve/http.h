// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstdint>
#include <functional>
#include <list>
#include <map>
#include <string>
#include <vector>

#include <libsoup/soup.h>
#include <nlohmann/json_fwd.hpp>

#include "serve/limits.h"

namespace lf::serve {

// Helpers for HTTP messages: read a request header (null if missing), set a response header, send a response, and
// answer a CORS preflight request with the allowed methods.
const char* header(SoupServerMessage* message, const char* name);
void set_header(SoupServerMessage* message, const char* name, const std::string& value);
void respond(SoupServerMessage* message, guint status, const char* type, const std::string& body);
void allow(SoupServerMessage* message, const char* methods);
// Responds with a file of the web page, or with status 404. `index` is the file of the path "/", and `policy` the
// Content-Security-Policy. Returns false if there is no such file.
bool respond_with_page(SoupServerMessage* message, const std::string& path, const char* index,
                       const std::string& policy);

// The reason for refusing an HTTP request. docs/reference/web-interface.md lists all reasons.
struct HttpRefusal {
  guint status;
  const char* reason;  // name for programs, one of kReasons
  const char* title;
  int retry_after = 0;  // delay in seconds before the client may try again; 0: never
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
inline constexpr HttpRefusal kView{500, "view", "the server cannot open a view; see its log", 10};
inline constexpr HttpRefusal kPath{404, "path", "no such path (--path)"};
}  // namespace refusal

// Sends refusals to clients and counts them by reason. Main thread only.
class Refusals {
 public:
  void answer(SoupServerMessage* message, const std::string& client, const HttpRefusal& refusal);
  void answer(SoupServerMessage* message, const std::string& client, const HttpRefusal& refusal,
              const nlohmann::json& more);
  std::string metrics() const;

 private:
  std::map<std::string, uint64_t> count_;
};

// An HTTP server, with TLS if there is a certificate. It protects itself from floods and slow clients. It refuses
// requests with a duplicated security-relevant header, or with a body that is too long or has no length, and discards
// the body. It ignores the header Range, because responses are always complete. A client has kHandshake seconds for the
// TLS handshake, kRequest seconds to send a whole request and kResponse seconds to read the response. Slower
// connections are closed. At most kMost connections are open; for one more, choose_victim() selects a connection to
// close. Main thread only.
//
// A TLS handshake costs the main thread some 10 ms, so handshakes are limited, too. At most kMaxHandshakes run at a
// time, and each subscriber (an IPv4 address or an IPv6 /64 network) gets kHandshakesPerSecond. The next handshake is
// the latest waiting one of the subscriber with the fewest connections. If others wait, a handshake is closed after
// kHandshakeSlice.
class HttpListener {
 public:
  // GLib runs handshakes in a pool that starts with 10 threads. kMaxHandshakes is smaller, so that no handshake waits
  // for a thread.
  static constexpr size_t kMost = 256, kMaxHandshakes = 8;
  static constexpr double kHandshakesPerSecond = 20, kHandshakesAtOnce = 40;
  static constexpr int64_t kHandshakeSlice = 300000;                       // microseconds
  static constexpr int64_t kHandshake = 5, kRequest = 10, kResponse = 30;  // seconds
  static constexpr size_t kFairShare = 16;   // number of connections per subscriber that are not closed first
  static constexpr int64_t kIdle = 1000000;  // microseconds without data until a connection is idle

  struct Settings {
    const char* name;     // value of the header Server
    const char* caching;  // value of the header Cache-Control
    size_t max_body;      // maximum size of a request's body, bytes
    std::function<void(SoupServerMessage* message, const std::string& path, GHashTable* query)> on_request;
    std::function<void(SoupServerMessage* message, const HttpRefusal& refusal)> on_refusal;
  };
  // Listens on the address. Takes a reference to `certificate`; without a certificate (null), connections are not
  // encrypted. Throws Error that names `address`.
  HttpListener(const std::string& address, int port, GTlsCertificate* certificate, Settings settings);
  ~HttpListener();
  HttpListener(const HttpListener&) = delete;

  // Replaces the certificate, not null, for new connections. The constructor must have received a certificate, too.
  void set_certificate(GTlsCertificate* certificate);
  int port() const { return port_; }
  size_t size();
  uint64_t closed() const { return closed_; }

  enum class Progress { kNothing, kSome, kRequest };
  struct ConnectionInfo {
    std::string subscriber;
    int64_t since;  // g_get_monotonic_time()
    Progress progress;
  };
  // Selects a connection to close; `all` must not be empty. The choice is the oldest connection of a subscriber with
  // more than kFairShare connections, otherwise the oldest idle connection, otherwise the oldest without a whole
  // request. A flood, from however many addresses, must therefore open kMost connections before it can close the
  // connection of an honest client.
  static size_t choose_victim(const std::vector<ConnectionInfo>& all, int64_t now);

 private:
  enum class Phase { kHandshake, kRequest, kResponse };
  struct Connection {
    GWeakRef connection;  // a GSocketConnection that libsoup owns and may release in another thread
    std::string subscriber, remote;
    int64_t since;  // g_get_monotonic_time() at the start of the phase
    Phase phase;
    bool ended = false;
  };
  struct Handshake;
  static constexpr size_t kRefusedBody = 1 << 20;  // bytes

  void check_headers(SoupServerMessage* message);
  void note_request(SoupServerMessage* message);
  void limit_body(SoupServerMessage* message);
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

  const Settings settings_;
  SoupServer* server_;
  GTlsCertificate* certificate_;
  GSocketService* service_;
  int port_ = 0;
  guint timer_ = 0, handshake_timer_ = 0;
  std::list<Connection> open_;
  std::list<Handshake*> handshakes_;  // connections during their handshake
  AddressLimit handshake_limit_{kHandshakesPerSecond, kHandshakesAtOnce};
  uint64_t closed_ = 0;
};

}  // namespace lf::serve
