// SPDX-License-Identifier: LGPL-2.1-or-later
#include "http_server.h"

#include <unistd.h>

#include <algorithm>
#include <fstream>
#include <nlohmann/json.hpp>
#include <sstream>

#include "base/error.h"
#include "client_address.h"
#include "log.h"

namespace lf::serve {
namespace {

constexpr std::string_view kWhep = "/whep";

std::string address_of(SoupServerMessage* message) {
  GSocketAddress* address = soup_server_message_get_remote_address(message);
  if (!address || !G_IS_INET_SOCKET_ADDRESS(address)) return "";
  g_autofree gchar* text = g_inet_address_to_string(g_inet_socket_address_get_address(G_INET_SOCKET_ADDRESS(address)));
  return plain_address(text);
}

long resident_bytes() {
  std::ifstream statm("/proc/self/statm");
  long size = 0, resident = 0;
  statm >> size >> resident;
  return resident * sysconf(_SC_PAGESIZE);
}

std::unique_ptr<Certificate> load_certificate(const ServerOptions& options) {
  if (options.certificate.empty() != options.key.empty())
    throw Error("--tls-certificate and --tls-key: one needs the other");
  return options.certificate.empty() ? nullptr : std::make_unique<Certificate>(options.certificate, options.key);
}

}  // namespace

HttpServer::HttpServer(const ServerOptions& options, const Limits& limits)
    : options_(options),
      limits_(limits),
      access_(options.token, options.origins, options.hosts),
      whep_(options.whep, limits, refusals_),
      wrong_tokens_(Limits::kWrongTokens, Limits::kWrongTokensAtOnce),
      certificate_(load_certificate(options)) {
  if (!is_loopback(options.address) && !certificate_ && !options.insecure)
    throw Error("--listen " + options.address + ": others can listen in; needs --tls-certificate and --tls-key, or " +
                "--insecure if that does not matter");
  server_ = soup_server_new("server-header", "lf-serve", nullptr);
  soup_server_add_early_handler(
      server_, nullptr,
      [](SoupServer*, SoupServerMessage* message, const char*, GHashTable*, gpointer data) {
        static_cast<HttpServer*>(data)->begin(message);
      },
      this, nullptr);
  soup_server_add_handler(
      server_, nullptr,
      [](SoupServer*, SoupServerMessage* message, const char* path, GHashTable* query, gpointer data) {
        static_cast<HttpServer*>(data)->handle(message, path, query);
      },
      this, nullptr);
  try {
    connections_ =
        std::make_unique<Connections>(server_, options.address == "localhost" ? "127.0.0.1" : options.address,
                                      options.port, certificate_ ? certificate_->get() : nullptr);
  } catch (const Error& error) {
    g_object_unref(server_);
    throw Error(std::string("--listen ") + error.what());
  }
  if (!certificate_) return;
  constexpr guint kEvery = 1;  // seconds
  certificate_timer_ = g_timeout_add_seconds(
      kEvery,
      [](gpointer data) -> gboolean {
        static_cast<HttpServer*>(data)->renew_certificate();
        return G_SOURCE_CONTINUE;
      },
      this);
}

// Programs that renew certificates replace the two files one after the other: a key that does not fit yet is not the
// last word.
void HttpServer::renew_certificate() {
  try {
    if (!certificate_->reload()) return;
    connections_->set_certificate(certificate_->get());
    say("new connections use the new certificate in " + options_.certificate);
  } catch (const Error& error) {
    say(std::string("the certificate stays as it was: ") + error.what());
  }
}

HttpServer::~HttpServer() {
  if (certificate_timer_) g_source_remove(certificate_timer_);
  connections_.reset();
  soup_server_disconnect(server_);
  g_object_unref(server_);
}

std::string HttpServer::url() const {
  const std::string host =
      options_.address.find(':') == std::string::npos ? options_.address : "[" + options_.address + "]";
  return (options_.certificate.empty() ? "http://" : "https://") + host + ":" + std::to_string(connections_->port()) +
         "/";
}

void HttpServer::serve(LightField& field, Sessions& sessions) {
  field_ = &field;
  sessions_ = &sessions;
}

void HttpServer::stop() {
  field_ = nullptr;
  sessions_ = nullptr;
}

Whep::Client HttpServer::client_of(SoupServerMessage* message) const {
  const std::string peer = address_of(message);
  Whep::Client client{client_address(peer, header(message, "X-Forwarded-For"), options_.proxies), ""};
  if (options_.proxies.contains(peer)) client.prefix = path_prefix(header(message, "X-Forwarded-Prefix"));
  return client;
}

// Before the body is read: nobody needs to read one that won't be taken.
void HttpServer::begin(SoupServerMessage* message) {
  set_common_headers(message, "no-cache");
  const Refusal* const refusal = refuse_early(message, Offer::kMaxBytes);
  if (!refusal) return;
  connections_->refused(message);
  refusals_.answer(message, client_of(message).address, *refusal);
}

void HttpServer::handle(SoupServerMessage* message, const std::string& path, GHashTable* query) {
  connections_->asked(message);
  const std::string method = soup_server_message_get_method(message);
  if (path == "/healthz") return respond(message, SOUP_STATUS_OK, "text/plain", "ok\n");
  const Whep::Client client = client_of(message);
  if (!access_.allows_host(header(message, "Host"))) return refusals_.answer(message, client.address, refusal::kHost);
  const bool whep = path == kWhep || path.starts_with(std::string(kWhep) + "/");
  const bool data = path == "/array.json" || path == "/monitor.json" || path == "/metrics" || path == "/mosaic.json" ||
                    path == "/mosaic.jpg";
  if (!whep && !data) {
    if (method == "GET" || method == "HEAD") return page(message, path);
    set_header(message, "Allow", "GET, HEAD");
    return respond(message, SOUP_STATUS_METHOD_NOT_ALLOWED, "text/plain", "GET only\n");
  }
  if (!admit(message, client)) return;
  if (method == "OPTIONS" && whep)
    return whep_.options(message, !access_.asks_for_token() || access_.has_token(header(message, "Authorization")));
  if (method == "OPTIONS") return allow(message, "GET, OPTIONS");
  if (data && method != "GET" && method != "HEAD") {
    set_header(message, "Allow", "GET, HEAD");
    return respond(message, SOUP_STATUS_METHOD_NOT_ALLOWED, "text/plain", "GET only\n");
  }
  if (!sessions_) return wait(message, client);
  serve(message, client, path, query);
}

void HttpServer::wait(SoupServerMessage* message, const Whep::Client& client) {
  if (filmed_)
    refusals_.answer(message, client.address, refusal::kFilming, {{"progress", *filmed_}});
  else
    refusals_.answer(message, client.address, refusal::kStarting);
}

void HttpServer::serve(SoupServerMessage* message, const Whep::Client& client, const std::string& path,
                       GHashTable* query) {
  if (path == "/array.json") return respond(message, SOUP_STATUS_OK, "application/json", field_->array()->json());
  if (path == "/monitor.json")
    return respond(message, SOUP_STATUS_OK, "application/json",
                   to_json(sessions_->monitor(), field_->array()->names()).dump());
  if (path.starts_with("/mosaic.")) return mosaic(message, path.ends_with(".jpg"));
  if (path == "/metrics") return respond(message, SOUP_STATUS_OK, "text/plain; version=0.0.4", metrics());
  if (path == kWhep) return whep_.endpoint(message, client, query, *sessions_);
  whep_.session(message, path.substr(kWhep.size() + 1), *sessions_);
}

void HttpServer::mosaic(SoupServerMessage* message, bool picture) {
  try {
    if (!picture) return respond(message, SOUP_STATUS_OK, "application/json", field_->mosaic_state());
    const std::vector<uint8_t> jpeg = field_->mosaic_jpeg();
    respond(message, SOUP_STATUS_OK, "image/jpeg", std::string(jpeg.begin(), jpeg.end()));
  } catch (const Error& error) {
    respond(message, SOUP_STATUS_NOT_FOUND, "text/plain", std::string(error.what()) + "\n");
  }
}

// Checks origin and token, and sets the headers that let a page of an allowed origin read the response.
bool HttpServer::admit(SoupServerMessage* message, const Whep::Client& client) {
  const char *origin = header(message, "Origin"), *host = header(message, "Host");
  if (!access_.allows_origin(origin, host) || !access_.allows_site(header(message, "Sec-Fetch-Site"), origin, host)) {
    refusals_.answer(message, client.address, refusal::kOrigin);
    return false;
  }
  if (origin) {
    set_header(message, "Access-Control-Allow-Origin", origin);
    set_header(message, "Access-Control-Expose-Headers", "Location, Retry-After, Link");
    set_header(message, "Vary", "Origin");
  }
  // Browsers ask what is allowed without the token.
  const bool asks = g_str_equal(soup_server_message_get_method(message), "OPTIONS");
  return (asks && !header(message, "Authorization")) || knows_token(message, client);
}

// A right token is never limited: wrong ones, from whatever addresses, keep out nobody who has it.
bool HttpServer::knows_token(SoupServerMessage* message, const Whep::Client& client) {
  if (!access_.asks_for_token()) return true;
  const char* given = header(message, "Authorization");
  const std::string who = subscriber(client.address);
  const int64_t now = g_get_monotonic_time();
  if (access_.has_token(given)) return true;
  if (given && !wrong_tokens_.take(who, now)) {
    refusals_.answer(message, client.address, refusal::kTokenRate);
    return false;
  }
  set_header(message, "WWW-Authenticate", "Bearer");
  refusals_.answer(message, client.address, refusal::kToken);
  return false;
}

void HttpServer::page(SoupServerMessage* message, const std::string& path) {
  const std::string name = "/lightfield" + (path == "/" ? "/index.html" : path);
  g_autoptr(GBytes) bytes = g_resources_lookup_data(name.c_str(), G_RESOURCE_LOOKUP_FLAGS_NONE, nullptr);
  if (!bytes) return respond(message, SOUP_STATUS_NOT_FOUND, "text/plain", "not here\n");
  gsize size = 0;
  const char* data = static_cast<const char*>(g_bytes_get_data(bytes, &size));
  std::string frames;
  for (const std::string& origin : access_.origins())
    if (origin != "null") frames += " " + origin;
  // Others' pages may use the element; what they may watch is decided when they ask for it.
  set_header(message, "Access-Control-Allow-Origin", "*");
  set_header(message, "Cross-Origin-Resource-Policy", "cross-origin");
  set_header(message, "Content-Security-Policy",
             "default-src 'self'; img-src 'self' data:; object-src 'none'; base-uri 'none'; form-action 'none'; "
             "frame-ancestors 'self'" +
                 frames);
  const char* type = path.ends_with(".js")    ? "text/javascript; charset=utf-8"
                     : path.ends_with(".css") ? "text/css; charset=utf-8"
                     : path.ends_with(".svg") ? "image/svg+xml"
                                              : "text/html; charset=utf-8";
  respond(message, SOUP_STATUS_OK, type, std::string(data, size));
}

std::string HttpServer::metrics() const {
  const Viewer::Figures figures = sessions_->figures();
  std::ostringstream out;
  const auto put = [&out](const char* name, const char* type, const char* help, auto value) {
    out << "# HELP lightfield_" << name << ' ' << help << "\n# TYPE lightfield_" << name << ' ' << type
        << "\nlightfield_" << name << ' ' << value << '\n';
  };
  put("viewers", "gauge", "Viewers now.", sessions_->size());
  put("viewers_total", "counter", "Viewers that were let in.", sessions_->opened());
  put("pictures_total", "counter", "Pictures composed.", figures.pictures);
  put("incomplete_pictures_total", "counter", "Pictures of which something was missing.", figures.incomplete);
  put("camera_bytes_total", "counter", "Bytes of answers that came from the cameras.", field_->answer_bytes());
  put("composed_bytes_total", "counter", "Bytes of answers that pictures were composed of.", figures.answer_bytes);
  put("video_bytes_total", "counter", "Bytes of RTP packets for browsers.", figures.video_bytes);
  put("refused_messages_total", "counter", "Messages on data channels that were not understood or too many.",
      figures.refused_messages);
  put("resident_bytes", "gauge", "Memory of the process.", resident_bytes());
  put("connections", "gauge", "TCP connections now.", connections_->size());
  put("closed_connections_total", "counter", "TCP connections that took too long or were too many.",
      connections_->closed());
  put("shed_step", "gauge", "What is left away for want of processors: 0 nothing, 1 and 2 trials, 3 rate, 4 size.",
      sessions_->shedding().step());
  put("waiting", "gauge", "Tickets in the queue for seats.", sessions_->seats().waiting());
  if (!field_->is_local()) {
    const std::vector<size_t> silent = field_->silent_nodes();
    out << "# HELP lightfield_node_silent Hosts with cameras that are asked and do not answer.\n"
           "# TYPE lightfield_node_silent gauge\n";
    for (size_t node = 0; node < field_->nodes(); node++)
      out << "lightfield_node_silent{node=\"" << field_->node_name(node) << "\"} " << std::ranges::count(silent, node)
          << '\n';
  }
  out << refusals_.metrics();
  if (limits_.monitor > 0) out << to_metrics(sessions_->monitor(), field_->array()->names());
  return out.str();
}

}  // namespace lf::serve
