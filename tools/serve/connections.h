// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <libsoup/soup.h>

#include <cstdint>
#include <list>
#include <string>
#include <vector>

#include "rate_limit.h"

namespace lf::serve {

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
