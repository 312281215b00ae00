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

// The TLS certificate of the server, from two PEM files that a renewal program may replace while the server runs. Not
// thread-safe.
class Certificate {
 public:
  // Throws Error that names an unusable file. For example, the key file must not be accessible to other users.
  Certificate(std::string certificate_file, std::string key_file);
  ~Certificate() { g_object_unref(certificate_); }
  Certificate(const Certificate&) = delete;

  GTlsCertificate* get() const { return certificate_; }  // valid until reload() or destruction
  // Reads the files again if they have changed, and returns true if there is a new certificate. Throws Error if the new
  // files are unusable. The old certificate then stays in use, and the files are read again only after another change.
  bool reload();

 private:
  // Follows links, because renewal programs often replace a link.
  using Version = std::array<int64_t, 4>;
  static Version version_of(const std::string& path);

  const std::string certificate_file_, key_file_;
  std::array<Version, 2> read_;
  GTlsCertificate* certificate_;
};

// The WHEP endpoint (/whep), where browsers start and end the stream of a view (draft-ietf-wish-whep;
// docs/reference/web-interface.md). The caller checks origin and token of each request. Main thread only.
class WhepEndpoint {
 public:
  struct Options {
    std::map<std::string, CameraPath> paths;  // camera paths (views.json) that viewers can play, by name
    IceServers ice;
    std::set<std::string> relays;  // addresses of TURN servers, which are accepted in candidates
    std::string media_address;     // local address that sends video; empty: any
  };
  struct Client {
    std::string address;
    std::string prefix;
  };

  WhepEndpoint(Options options, const Limits& limits, Refusals& refusals);

  void endpoint(SoupServerMessage* message, const Client& client, GHashTable* query, Sessions& sessions);
  void session(SoupServerMessage* message, const std::string& name, Sessions& sessions);
  void options(SoupServerMessage* message, bool trusted);

 private:
  void refuse_offer(SoupServerMessage* message, const Client& client, const std::string& why);
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
  int port = 8080;               // 0: the system selects a free port
  std::string certificate, key;  // PEM files, reloaded when they change; either both or none
  std::string token;
  std::set<std::string> origins, hosts, proxies;
  WhepEndpoint::Options whep;
  bool insecure = false;
};

// The HTTP server of lf-serve: the page, the WHEP endpoint, metrics and health (docs/reference/web-interface.md). The
// page is available at once, so that viewers see the progress while the cameras open. Everything else is available
// after serve(). Main thread only.
class HttpServer {
 public:
  // Throws Error.
  HttpServer(const ServerOptions& options, const Limits& limits);
  ~HttpServer();
  HttpServer(const HttpServer&) = delete;

  std::string url() const;
  // Sets the reason why viewers wait until serve(): lf-scene films the built-in scene (with the progress), or the
  // cameras are being opened.
  void show_filming(double progress) { filming_progress_ = progress; }
  void show_starting() { filming_progress_.reset(); }
  // Starts to serve views of the light field. The arguments must stay valid until stop().
  void serve(LightField& field, Sessions& sessions);
  void stop();

 private:
  bool admit(SoupServerMessage* message, const WhepEndpoint::Client& client);
  bool check_token(SoupServerMessage* message, const WhepEndpoint::Client& client);
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
  std::unique_ptr<HttpListener> listener_;
  std::optional<double> filming_progress_;
  LightField* field_ = nullptr;
  Sessions* sessions_ = nullptr;
};

}  // namespace lf::serve
