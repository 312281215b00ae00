// SPDX-License-Identifier: LGPL-2.1-or-later
#include "http_server.h"

#include <unistd.h>

#include <cstdio>
#include <fstream>
#include <nlohmann/json.hpp>
#include <sstream>

#include "base/error.h"
#include "encoder.h"

namespace lf::serve {
namespace {

constexpr std::string_view kWhep = "/whep";
constexpr char kMethods[] = "POST, DELETE, OPTIONS";

const char* const kRefusals[] = {"origin", "token", "body", "type", "rate", "full", "offer", "path"};

const char* header(SoupServerMessage* message, const char* name) {
  return soup_message_headers_get_one(soup_server_message_get_request_headers(message), name);
}
void set_header(SoupServerMessage* message, const char* name, const std::string& value) {
  soup_message_headers_replace(soup_server_message_get_response_headers(message), name, value.c_str());
}
void respond(SoupServerMessage* message, guint status, const char* type, const std::string& body) {
  soup_server_message_set_status(message, status, nullptr);
  soup_server_message_set_response(message, type, SOUP_MEMORY_COPY, body.data(), body.size());
}

// What a page of another site may ask for.
void allow(SoupServerMessage* message, const char* methods) {
  set_header(message, "Access-Control-Allow-Methods", methods);
  set_header(message, "Access-Control-Allow-Headers", "Authorization, Content-Type");
  soup_server_message_set_status(message, SOUP_STATUS_NO_CONTENT, nullptr);
}

std::string address_of(SoupServerMessage* message) {
  GSocketAddress* address = soup_server_message_get_remote_address(message);
  if (!address || !G_IS_INET_SOCKET_ADDRESS(address)) return "";
  g_autofree gchar* text = g_inet_address_to_string(g_inet_socket_address_get_address(G_INET_SOCKET_ADDRESS(address)));
  return text;
}

long resident_bytes() {
  std::ifstream statm("/proc/self/statm");
  long size = 0, resident = 0;
  statm >> size >> resident;
  return resident * sysconf(_SC_PAGESIZE);
}

GTlsCertificate* load_certificate(const ServerOptions& options) {
  if (options.certificate.empty() != options.key.empty())
    throw Error("--tls-certificate and --tls-key: one needs the other");
  if (options.certificate.empty()) return nullptr;
  GError* error = nullptr;
  GTlsCertificate* certificate =
      g_tls_certificate_new_from_files(options.certificate.c_str(), options.key.c_str(), &error);
  if (certificate) return certificate;
  const std::string text = options.certificate + ": " + error->message;
  g_error_free(error);
  throw Error(text);
}

}  // namespace

HttpServer::HttpServer(const ServerOptions& options, const Limits& limits, LightField& field, Sessions& sessions)
    : limits_(limits),
      field_(field),
      sessions_(sessions),
      access_(options.token, options.origins, is_loopback(options.address)),
      paths_(options.paths),
      connects_(limits.connects_per_second, limits.connect_burst) {
  GTlsCertificate* certificate = load_certificate(options);
  if (!is_loopback(options.address) && !certificate && !options.insecure)
    throw Error("--listen " + options.address + ": others can listen in; needs --tls-certificate and --tls-key, or " +
                "--insecure if that does not matter");
  server_ = soup_server_new("server-header", "lf-serve", nullptr);
  if (certificate) {
    soup_server_set_tls_certificate(server_, certificate);
    g_object_unref(certificate);
  }
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
  const std::string host = options.address == "localhost" ? "127.0.0.1" : options.address;
  GSocketAddress* address = g_inet_socket_address_new_from_string(host.c_str(), static_cast<guint>(options.port));
  GError* error = nullptr;
  const bool listens =
      address &&
      soup_server_listen(server_, address, certificate ? SOUP_SERVER_LISTEN_HTTPS : SoupServerListenOptions(0), &error);
  if (address) g_object_unref(address);
  if (listens) return;
  const std::string text = "--listen " + options.address + ": " + (error ? error->message : "must be an IP address");
  g_clear_error(&error);
  g_object_unref(server_);
  throw Error(text);
}

HttpServer::~HttpServer() {
  soup_server_disconnect(server_);
  g_object_unref(server_);
}

std::string HttpServer::url() const {
  GSList* uris = soup_server_get_uris(server_);
  g_autofree gchar* text = uris ? g_uri_to_string(static_cast<GUri*>(uris->data)) : nullptr;
  g_slist_free_full(uris, reinterpret_cast<GDestroyNotify>(g_uri_unref));
  return text ? text : "";
}

void HttpServer::refuse(SoupServerMessage* message, Refusal why, guint status, const std::string& reason) {
  refused_[why]++;
  std::printf("%s: %u, %s\n", address_of(message).c_str(), status, reason.c_str());
  respond(message, status, "text/plain", reason + "\n");
}

// Before the body is read: nobody needs to read one that won't be taken.
void HttpServer::begin(SoupServerMessage* message) {
  // libsoup before 3.3 never closes a connection that waits for another request when the client has closed it.
  set_header(message, "Connection", "close");
  SoupMessageHeaders* headers = soup_server_message_get_request_headers(message);
  const SoupEncoding encoding = soup_message_headers_get_encoding(headers);
  const bool too_long = encoding == SOUP_ENCODING_CONTENT_LENGTH &&
                        soup_message_headers_get_content_length(headers) > static_cast<goffset>(Offer::kMaxBytes);
  if (!too_long && (encoding == SOUP_ENCODING_CONTENT_LENGTH || encoding == SOUP_ENCODING_NONE)) return;
  soup_message_body_set_accumulate(soup_server_message_get_request_body(message), FALSE);
  if (too_long)
    refuse(message, kBody, SOUP_STATUS_REQUEST_ENTITY_TOO_LARGE, "the body is too long");
  else
    refuse(message, kBody, SOUP_STATUS_LENGTH_REQUIRED, "the body has no length");
}

void HttpServer::handle(SoupServerMessage* message, const std::string& path, GHashTable* query) {
  const std::string method = soup_server_message_get_method(message);
  set_header(message, "Cache-Control", "no-cache");
  set_header(message, "X-Content-Type-Options", "nosniff");
  if (path == "/healthz") return respond(message, SOUP_STATUS_OK, "text/plain", "ok\n");
  if (path == kWhep || path.starts_with(std::string(kWhep) + "/")) {
    if (!admit(message)) return;
    if (path == kWhep) return whep(message, query);
    return session(message, path.substr(kWhep.size() + 1));
  }
  const bool array = path == "/array.json", monitor = path == "/monitor.json";
  if (array || monitor) {
    if (!admit(message)) return;
    if (method == "OPTIONS") return allow(message, "GET, OPTIONS");
  }
  if (method != "GET" && method != "HEAD") {
    set_header(message, "Allow", "GET, HEAD");
    return respond(message, SOUP_STATUS_METHOD_NOT_ALLOWED, "text/plain", "GET only\n");
  }
  if (array) return respond(message, SOUP_STATUS_OK, "application/json", field_.array().json());
  if (monitor)
    return respond(message, SOUP_STATUS_OK, "application/json",
                   to_json(sessions_.monitor(), field_.array().names()).dump());
  if (path != "/metrics") return page(message, path);
  if (admit(message)) respond(message, SOUP_STATUS_OK, "text/plain; version=0.0.4", metrics());
}

// Origin and token, and the headers that let a page of an allowed origin read the response.
bool HttpServer::admit(SoupServerMessage* message) {
  const char* origin = header(message, "Origin");
  if (!access_.allows_origin(origin, header(message, "Host"))) {
    refuse(message, kOrigin, SOUP_STATUS_FORBIDDEN, "this origin may not watch (--origin)");
    return false;
  }
  if (origin) {
    set_header(message, "Access-Control-Allow-Origin", origin);
    set_header(message, "Access-Control-Expose-Headers", "Location, Retry-After");
    set_header(message, "Vary", "Origin");
  }
  // Browsers ask what is allowed without the token.
  if (g_str_equal(soup_server_message_get_method(message), "OPTIONS")) return true;
  if (access_.has_token(header(message, "Authorization"))) return true;
  set_header(message, "WWW-Authenticate", "Bearer");
  refuse(message, kToken, SOUP_STATUS_UNAUTHORIZED, "the bearer token is missing or wrong");
  return false;
}

void HttpServer::whep(SoupServerMessage* message, GHashTable* query) {
  const std::string method = soup_server_message_get_method(message);
  set_header(message, "Accept-Post", "application/sdp");
  if (method == "OPTIONS") return allow(message, kMethods);
  if (method != "POST") {
    set_header(message, "Allow", kMethods);
    return respond(message, SOUP_STATUS_METHOD_NOT_ALLOWED, "text/plain", "POST an offer\n");
  }
  const char* type = soup_message_headers_get_content_type(soup_server_message_get_request_headers(message), nullptr);
  if (g_strcmp0(type, "application/sdp") != 0)
    return refuse(message, kType, SOUP_STATUS_UNSUPPORTED_MEDIA_TYPE, "the offer must be application/sdp");
  if (!connects_.take(address_of(message), g_get_monotonic_time())) {
    set_header(message, "Retry-After", "10");
    return refuse(message, kRate, 429, "too many connects");
  }
  const auto value = [query](const char* name) {
    return query ? static_cast<const char*>(g_hash_table_lookup(query, name)) : nullptr;
  };
  const auto picture = view_size(value("width"), value("height"), limits_);
  if (!picture) return refuse(message, kOffer, SOUP_STATUS_BAD_REQUEST, "width and height must be pixels");
  const auto distance = eye_distance(value("eye-distance"));
  if (!distance) return refuse(message, kOffer, SOUP_STATUS_BAD_REQUEST, "eye-distance must be metres");
  Wish wish{picture->width, picture->height, *distance, ""};
  if (const char* name = value("path")) {
    const auto found = paths_.find(name);
    if (found == paths_.end()) return refuse(message, kPath, SOUP_STATUS_NOT_FOUND, "there is no such path (--path)");
    wish.path = found->second;
  }

  SoupMessageBody* body = soup_server_message_get_request_body(message);
  g_autoptr(GBytes) bytes = soup_message_body_flatten(body);
  gsize size = 0;
  const char* data = static_cast<const char*>(g_bytes_get_data(bytes, &size));
  std::string reason;
  auto offer = parse_offer(std::string(data ? data : "", size), can_encode(VideoCodec::kH264),
                           can_encode(VideoCodec::kVp8), &reason);
  if (!offer) return refuse(message, kOffer, SOUP_STATUS_BAD_REQUEST, reason);
  if (sessions_.full(wish)) {
    set_header(message, "Retry-After", "10");
    return refuse(message, kFull, SOUP_STATUS_SERVICE_UNAVAILABLE, "too many viewers");
  }
  g_object_ref(message);
  soup_server_message_pause(message);
  // The browser may have gone when the answer is there: nobody waits for it then.
  auto name = std::make_shared<std::string>();
  auto waits = std::make_shared<bool>(true);
  using Waits = std::shared_ptr<bool>;
  g_signal_connect_data(
      message, "finished", G_CALLBACK(+[](SoupServerMessage*, gpointer data) { **static_cast<Waits*>(data) = false; }),
      new Waits(waits), [](gpointer data, GClosure*) { delete static_cast<Waits*>(data); }, GConnectFlags(0));
  const auto answer = [this, message, name, waits](const std::string& sdp, const std::string& problem) {
    if (*waits && sdp.empty()) {
      refuse(message, kOffer, SOUP_STATUS_BAD_REQUEST, problem);
    } else if (*waits) {
      set_header(message, "Location", std::string(kWhep) + "/" + *name);
      respond(message, SOUP_STATUS_CREATED, "application/sdp", sdp);
    }
    if (*waits) soup_server_message_unpause(message);
    g_object_unref(message);
  };
  try {
    *name = sessions_.open(std::move(*offer), wish, answer);
  } catch (const Error& error) {
    respond(message, SOUP_STATUS_INTERNAL_SERVER_ERROR, "text/plain", std::string(error.what()) + "\n");
    soup_server_message_unpause(message);
    g_object_unref(message);
  }
}

void HttpServer::session(SoupServerMessage* message, const std::string& name) {
  const std::string method = soup_server_message_get_method(message);
  if (method == "OPTIONS") return allow(message, kMethods);
  if (method != "DELETE") {
    set_header(message, "Allow", "DELETE, OPTIONS");
    return respond(message, SOUP_STATUS_METHOD_NOT_ALLOWED, "text/plain", "DELETE only\n");
  }
  const bool found = sessions_.close(name, "the browser leaves");
  respond(message, found ? SOUP_STATUS_OK : SOUP_STATUS_NOT_FOUND, "text/plain", found ? "" : "no such session\n");
}

void HttpServer::page(SoupServerMessage* message, const std::string& path) {
  const std::string name = "/lightfield" + (path == "/" ? "/index.html" : path);
  g_autoptr(GBytes) bytes = g_resources_lookup_data(name.c_str(), G_RESOURCE_LOOKUP_FLAGS_NONE, nullptr);
  if (!bytes) return respond(message, SOUP_STATUS_NOT_FOUND, "text/plain", "not here\n");
  gsize size = 0;
  const char* data = static_cast<const char*>(g_bytes_get_data(bytes, &size));
  // Others' pages may use the element; what they may watch is decided when they ask for it.
  set_header(message, "Access-Control-Allow-Origin", "*");
  set_header(message, "Content-Security-Policy",
             "default-src 'self'; img-src 'self' data:; object-src 'none'; base-uri 'none'; form-action 'none'; "
             "frame-ancestors *");
  const char* type = path.ends_with(".js")    ? "text/javascript; charset=utf-8"
                     : path.ends_with(".css") ? "text/css; charset=utf-8"
                     : path.ends_with(".svg") ? "image/svg+xml"
                                              : "text/html; charset=utf-8";
  respond(message, SOUP_STATUS_OK, type, std::string(data, size));
}

std::string HttpServer::metrics() const {
  const Viewer::Figures figures = sessions_.figures();
  std::ostringstream out;
  const auto put = [&out](const char* name, const char* type, const char* help, auto value) {
    out << "# HELP lightfield_" << name << ' ' << help << "\n# TYPE lightfield_" << name << ' ' << type
        << "\nlightfield_" << name << ' ' << value << '\n';
  };
  put("viewers", "gauge", "Viewers now.", sessions_.size());
  put("viewers_total", "counter", "Viewers that were let in.", sessions_.opened());
  put("pictures_total", "counter", "Pictures composed.", figures.pictures);
  put("incomplete_pictures_total", "counter", "Pictures of which something was missing.", figures.incomplete);
  put("camera_bytes_total", "counter", "Bytes of answers that came from the cameras.", field_.answer_bytes());
  put("composed_bytes_total", "counter", "Bytes of answers that pictures were composed of.", figures.answer_bytes);
  put("video_bytes_total", "counter", "Bytes of RTP packets for browsers.", figures.video_bytes);
  put("refused_messages_total", "counter", "Messages on data channels that were not understood or too many.",
      figures.refused_messages);
  put("resident_bytes", "gauge", "Memory of the process.", resident_bytes());
  out << "# HELP lightfield_refused_total Requests that were refused.\n# TYPE lightfield_refused_total counter\n";
  for (size_t i = 0; i < refused_.size(); i++)
    out << "lightfield_refused_total{reason=\"" << kRefusals[i] << "\"} " << refused_[i] << '\n';
  if (limits_.monitor > 0) out << to_metrics(sessions_.monitor(), field_.array().names());
  return out.str();
}

}  // namespace lf::serve
