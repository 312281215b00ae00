// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <libsoup/soup.h>

#include <array>
#include <map>
#include <set>
#include <string>

#include "access.h"
#include "rate_limit.h"
#include "sessions.h"

namespace lf::serve {

struct ServerOptions {
  std::string address = "127.0.0.1";
  int port = 8080;               // 0: any
  std::string certificate, key;  // PEM files; both or none
  std::string token;
  std::set<std::string> origins;
  std::map<std::string, std::string> paths;  // views.json files that viewers may have flown, by name
  bool insecure = false;                     // other addresses than loopback without TLS
};

// The page, the WHEP endpoint (draft-ietf-wish-whep), metrics and health over HTTP. On the main thread alone.
class HttpServer {
 public:
  // Throws Error.
  HttpServer(const ServerOptions& options, const Limits& limits, LightField& field, Sessions& sessions);
  ~HttpServer();
  HttpServer(const HttpServer&) = delete;

  std::string url() const;

 private:
  enum Refusal { kOrigin, kToken, kBody, kType, kRate, kFull, kOffer, kPath, kRefused };
  void refuse(SoupServerMessage* message, Refusal why, guint status, const std::string& reason);
  bool admit(SoupServerMessage* message);
  void begin(SoupServerMessage* message);
  void handle(SoupServerMessage* message, const std::string& path, GHashTable* query);
  void whep(SoupServerMessage* message, GHashTable* query);
  void session(SoupServerMessage* message, const std::string& name);
  void page(SoupServerMessage* message, const std::string& path);
  std::string metrics() const;

  Limits limits_;
  LightField& field_;
  Sessions& sessions_;
  Access access_;
  std::map<std::string, std::string> paths_;
  AddressLimit connects_;
  SoupServer* server_;
  std::array<uint64_t, kRefused> refused_{};
};

}  // namespace lf::serve
