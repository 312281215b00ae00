// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <libsoup/soup.h>

#include <memory>
#include <optional>
#include <set>
#include <string>

#include "access.h"
#include "certificate.h"
#include "connections.h"
#include "http_reply.h"
#include "rate_limit.h"
#include "sessions.h"
#include "whep.h"

namespace lf::serve {

struct ServerOptions {
  std::string address = "127.0.0.1";
  int port = 8080;               // 0: any
  std::string certificate, key;  // PEM files, read again when they change; both or none
  std::string token;
  std::set<std::string> origins, hosts, proxies;
  Whep::Options whep;
  bool insecure = false;  // addresses other than loopback are allowed without TLS
};

// The page, the WHEP endpoint, metrics and health over HTTP (docs/web-interface.md): the page from the beginning, the
// rest from serve() on. On the main thread alone.
class HttpServer {
 public:
  // Throws Error.
  HttpServer(const ServerOptions& options, const Limits& limits);
  ~HttpServer();
  HttpServer(const HttpServer&) = delete;

  std::string url() const;
  // Says what viewers have to wait for, until serve(): the first film, of which this part is done, or the cameras.
  void films(double progress) { filmed_ = progress; }
  void starts() { filmed_.reset(); }
  // Serves the light field's views, too, from now on. Both are borrowed until stop().
  void serve(LightField& field, Sessions& sessions);
  void stop();

 private:
  bool admit(SoupServerMessage* message, const Whep::Client& client);
  bool knows_token(SoupServerMessage* message, const Whep::Client& client);
  void begin(SoupServerMessage* message);
  void handle(SoupServerMessage* message, const std::string& path, GHashTable* query);
  void serve(SoupServerMessage* message, const Whep::Client& client, const std::string& path, GHashTable* query);
  void page(SoupServerMessage* message, const std::string& path);
  void mosaic(SoupServerMessage* message, bool picture);
  void wait(SoupServerMessage* message, const Whep::Client& client);
  Whep::Client client_of(SoupServerMessage* message) const;
  std::string metrics() const;
  void renew_certificate();

  ServerOptions options_;
  Limits limits_;
  Access access_;
  Refusals refusals_;
  Whep whep_;
  AddressLimit wrong_tokens_;
  std::unique_ptr<Certificate> certificate_;  // null: no TLS
  guint certificate_timer_ = 0;
  SoupServer* server_;
  std::unique_ptr<Connections> connections_;
  std::optional<double> filmed_;
  LightField* field_ = nullptr;
  Sessions* sessions_ = nullptr;
};

}  // namespace lf::serve
