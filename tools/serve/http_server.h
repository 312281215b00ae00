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

// TLS certificate of a server, from two PEM files that may be replaced at run time. Not thread-safe.
class Certificate {
 public:
  // Throws Error that names the unusable file. The key file must not be accessible to other users.
  Certificate(std::string certificate_file, std::string key_file);
  ~Certificate() { g_object_unref(certificate_); }
  Certificate(const Certificate&) = delete;

  GTlsCertificate* get() const { return certificate_; }  // borrowed until reload() or destruction
  // Reads the files again if they have changed. Returns true if the certificate is new. Throws Error if the files are
  // unusable; the old certificate then stays until the files change again.
  bool reload();

 private:
  // Identifies a version of a file. Links are followed, because renewal often replaces a link.
  using Version = std::array<int64_t, 4>;
  static Version version_of(const std::string& path);

  const std::string certificate_file_, key_file_;
  std::array<Version, 2> read_;
  GTlsCertificate* certificate_;
};

// The endpoint /whep and its sessions (draft-ietf-wish-whep; docs/reference/web-interface.md). The caller checks origin and
// token. Main thread only.
class WhepEndpoint {
 public:
  struct Options {
    std::map<std::string, std::string> paths;  // views.json files that viewers can play, by name
    IceServers ice;
    std::set<std::string> relays;  // addresses of relays; their candidates are accepted
    std::string media_address;     // local address for video; "": any
  };
  struct Client {
    std::string address;
    std::string prefix;  // path prefix added by a proxy, or ""
  };

  WhepEndpoint(Options options, const Limits& limits, Refusals& refusals);

  void endpoint(SoupServerMessage* message, const Client& client, GHashTable* query, Sessions& sessions);
  void session(SoupServerMessage* message, const std::string& name, Sessions& sessions);
  // Answers OPTIONS; `trusted`: the client has sent the token.
  void options(SoupServerMessage* message, bool trusted);

 private:
  void refuse_offer(SoupServerMessage* message, const Client& client, const std::string& why);
  // Returns std::nullopt if the request was refused.
  std::optional<ViewParams> view_params(SoupServerMessage* message, const Client& client, GHashTable* query);
  bool seat(SoupServerMessage* message, const Client& client, const ViewParams& view_params, const char* ticket,
            Sessions& sessions);
  void open(SoupServerMessage* message, const Client& client, Offer offer, const ViewParams& view_params,
            Sessions& sessions);
  void link(SoupServerMessage* message);

  Options options_;
  Limits limits_;
  Refusals& refusals_;
  AddressLimit connects_;
};

struct ServerOptions {
  std::string address = "127.0.0.1";
  int port = 8080;               // 0: any
  std::string certificate, key;  // PEM files, reloaded when they change; both or none
  std::string token;
  std::set<std::string> origins, hosts, proxies;
  WhepEndpoint::Options whep;
  bool insecure = false;
};

// Serves the page, the WHEP endpoint, metrics and health over HTTP (docs/reference/web-interface.md). The page is available at
// once, everything else after serve(). Main thread only.
class HttpServer {
 public:
  // Throws Error.
  HttpServer(const ServerOptions& options, const Limits& limits);
  ~HttpServer();
  HttpServer(const HttpServer&) = delete;

  std::string url() const;
  // Sets what viewers wait for until serve(): filming the scene, with its progress, or opening the cameras.
  void show_filming(double progress) { filming_progress_ = progress; }
  void show_starting() { filming_progress_.reset(); }
  // Also serves the views of the light field from now on. The arguments are borrowed until stop().
  void serve(LightField& field, Sessions& sessions);
  void stop();

 private:
  bool admit(SoupServerMessage* message, const WhepEndpoint::Client& client);
  bool check_token(SoupServerMessage* message, const WhepEndpoint::Client& client);
  void begin(SoupServerMessage* message);
  void handle(SoupServerMessage* message, const std::string& path, GHashTable* query);
  void serve(SoupServerMessage* message, const WhepEndpoint::Client& client, const std::string& path,
             GHashTable* query);
  void page(SoupServerMessage* message, const std::string& path);
  void mosaic(SoupServerMessage* message, bool picture);
  void wait(SoupServerMessage* message, const WhepEndpoint::Client& client);
  WhepEndpoint::Client client_of(SoupServerMessage* message) const;
  std::string metrics() const;
  void renew_certificate();

  ServerOptions options_;
  Limits limits_;
  Access access_;
  Refusals refusals_;
  WhepEndpoint whep_;
  AddressLimit wrong_tokens_;
  std::unique_ptr<Certificate> certificate_;  // null: no TLS
  guint certificate_timer_ = 0;
  SoupServer* server_;
  std::unique_ptr<Connections> connections_;
  std::optional<double> filming_progress_;
  LightField* field_ = nullptr;
  Sessions* sessions_ = nullptr;
};

}  // namespace lf::serve
