// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <libsoup/soup.h>

#include <cstdint>
#include <map>
#include <string>

namespace lf::serve {

// The TCP connections of an HTTP server: accepts them, with TLS where there is a certificate, and ends those that cost
// more than they are worth, whoever they are. One that has not sent a whole request after kRequest seconds is closed,
// and so is one that has not taken its response kResponse seconds later. At most kMost are open: for one more the
// subscriber that has most of them loses its oldest. On the main thread alone.
class Connections {
 public:
  static constexpr size_t kMost = 256;
  static constexpr int64_t kRequest = 10, kResponse = 30;  // seconds

  // Listens; `server` and `certificate` (or null) are borrowed. Throws Error that names `address`.
  Connections(SoupServer* server, const std::string& address, int port, GTlsCertificate* certificate);
  ~Connections();
  Connections(const Connections&) = delete;

  int port() const { return port_; }
  size_t size() const { return open_.size(); }
  uint64_t closed() const { return closed_; }  // connections closed because they took too long or were too many
  // The whole request of this connection is there.
  void asked(SoupServerMessage* message);

 private:
  struct Connection {
    std::string subscriber, remote;
    int64_t since;  // g_get_monotonic_time() of its beginning or of its request
    bool asked = false, ended = false;
  };
  static void forget(gpointer data, GObject* connection);
  void accept(GSocketConnection* connection);
  void end(GSocketConnection* connection);
  void tick();

  SoupServer* server_;
  GTlsCertificate* certificate_;
  GSocketService* service_;
  int port_ = 0;
  guint timer_ = 0;
  std::map<GSocketConnection*, Connection> open_;
  uint64_t closed_ = 0;
};

}  // namespace lf::serve
