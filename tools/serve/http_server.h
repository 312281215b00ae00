// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <array>
#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <set>
#include <string>

#include <gio/gio.h>
#include <libsoup/soup.h>

#include "serve/access.h"
#include "serve/http.h"
#include "serve/limits.h"
#include "serve/offer.h"
#include "serve/sessions.h"

namespace lf::serve {

// The TLS certificate of a server, from two PEM files that may be replaced while the server runs. Not thread-safe.
class Certificate {
 public:
  // Throws Error naming the file that can't be used. The key file must be closed to other users.
  Certificate(std::string certificate_file, std::string key_file);
  ~Certificate() { g_object_unref(certificate_); }
  Certificate(const Certificate&) = delete;

  GTlsCertificate* get() const { return certificate_; }  // borrowed until reload() or the end of this
  // Reads the files again if they have changed since they were read last. Returns whether there is another
  // certificate. Throws Error if the files can't be used: the certificate stays as it was, until they change again.
  bool reload();

 private:
  // What tells two versions of a file apart. Links are followed, because renewing often replaces a link.
  using Version = std::array<int64_t, 4>;
  static Version version_of(const std::string& path);

  const std::string certificate_file_, key_file_;
  std::array<Version, 2> read_;
  GTlsCertificate* certificate_;
};

// The endpoint /whep and its sessions (draft-ietf-wish-whep; docs/web-interface.md), behind whoever has looked at
// origin and token. On the main thread alone.
class Whep {
 public:
  struct Options {
    std::map<std::string, std::string> paths;  // views.json files that viewers may have flown, by name
    IceServers ice;
    std::set<std::string> relays;  // addresses of relays, whose candidates are taken
    std::string media_address;     // the only address of this machine that video comes from, or ""
  };
  struct Client {
    std::string address;  // address of the client, as text
    std::string prefix;   // the path that a proxy has put before ours, or ""
  };

  Whep(Options options, const Limits& limits, Refusals& refusals);

  // Answers requests to /whep.
  void endpoint(SoupServerMessage* message, const Client& client, GHashTable* query, Sessions& sessions);
  // Answers requests to /whep/NAME.
  void session(SoupServerMessage* message, const std::string& name, Sessions& sessions);
  // Answers OPTIONS; `trusted`: the client has shown the token.
  void options(SoupServerMessage* message, bool trusted);

 private:
  void refuse_offer(SoupServerMessage* message, const Client& client, const std::string& why);
  // Nothing where it was refused.
  std::optional<Wish> wish(SoupServerMessage* message, const Client& client, GHashTable* query);
  bool seat(SoupServerMessage* message, const Client& client, const Wish& wish, const char* ticket, Sessions& sessions);
  void open(SoupServerMessage* message, const Client& client, Offer offer, const Wish& wish, Sessions& sessions);
  void link(SoupServerMessage* message);

  Options options_;
  Limits limits_;
  Refusals& refusals_;
  AddressLimit connects_;
};

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
