// SPDX-License-Identifier: LGPL-2.1-or-later
#include "serve/http_server.h"

#include <algorithm>
#include <fstream>
#include <memory>
#include <optional>
#include <sstream>
#include <utility>

#include <openssl/pem.h>
#include <openssl/x509.h>
#include <sys/stat.h>
#include <unistd.h>
#include <nlohmann/json.hpp>

#include "base/file.h"
#include "base/json_value.h"
#include "base/text.h"
#include "serve/access.h"
#include "serve/pipelines.h"
#include "serve/process.h"

namespace lf::serve {
namespace {

using BioPtr = std::unique_ptr<BIO, decltype(&BIO_free)>;

BioPtr bio_of(const std::string& text) {
  return BioPtr(BIO_new_mem_buf(text.data(), static_cast<int>(text.size())), BIO_free);
}

// Checks that the key belongs to the certificate. GLib accepts any two files, and then every handshake fails.
void check_pair(const std::string& certificate_file, const std::string& certificate, const std::string& key_file,
                const std::string& key) {
  const BioPtr first = bio_of(certificate), second = bio_of(key);
  // Without this callback, OpenSSL asks for a passphrase on the terminal.
  const auto no_passphrase = [](char*, int, int, void*) { return 0; };
  const std::unique_ptr<X509, decltype(&X509_free)> x509(
      PEM_read_bio_X509(first.get(), nullptr, no_passphrase, nullptr), X509_free);
  const std::unique_ptr<EVP_PKEY, decltype(&EVP_PKEY_free)> secret(
      PEM_read_bio_PrivateKey(second.get(), nullptr, no_passphrase, nullptr), EVP_PKEY_free);
  if (!x509) throw Error(certificate_file + ": contains no certificate in PEM format");
  if (!secret)
    throw Error(key_file +
                ": contains no private key in PEM format, or the key has a passphrase, which must be removed");
  if (X509_check_private_key(x509.get(), secret.get()) != 1)
    throw Error(key_file + ": is not the private key of the certificate in " + certificate_file);
}

GTlsCertificate* load(const std::string& certificate_file, const std::string& key_file) {
  const std::string certificate = read_text_file(certificate_file);
  std::string key = read_secret_file(key_file);
  check_pair(certificate_file, certificate, key_file, key);
  std::string both = certificate + "\n" + key;
  g_autoptr(GError) error = nullptr;
  GTlsCertificate* loaded = g_tls_certificate_new_from_pem(both.data(), static_cast<gssize>(both.size()), &error);
  wipe(key);
  wipe(both);
  if (!loaded) throw Error(certificate_file + ": " + error->message);
  return loaded;
}

constexpr char kMethods[] = "POST, DELETE, OPTIONS";

int64_t seconds_now() { return g_get_real_time() / G_USEC_PER_SEC; }

const char* value_of(GHashTable* query, const char* name) {
  return query ? static_cast<const char*>(g_hash_table_lookup(query, name)) : nullptr;
}

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
    throw Error("--tls-certificate and --tls-key must be used together");
  return options.certificate.empty() ? nullptr : std::make_unique<Certificate>(options.certificate, options.key);
}

}  // namespace

Certificate::Version Certificate::version_of(const std::string& path) {
  struct stat status {};
  if (stat(path.c_str(), &status) != 0) return {};
  return {static_cast<int64_t>(status.st_ino), status.st_size, status.st_ctim.tv_sec, status.st_ctim.tv_nsec};
}

Certificate::Certificate(std::string certificate_file, std::string key_file)
    : certificate_file_(std::move(certificate_file)),
      key_file_(std::move(key_file)),
      read_{version_of(certificate_file_), version_of(key_file_)},
      certificate_(load(certificate_file_, key_file_)) {}

bool Certificate::reload() {
  const std::array now = {version_of(certificate_file_), version_of(key_file_)};
  if (now == read_) return false;
  read_ = now;
  GTlsCertificate* loaded = load(certificate_file_, key_file_);
  g_object_unref(certificate_);
  certificate_ = loaded;
  return true;
}

WhepEndpoint::WhepEndpoint(Options options, const Limits& limits, Refusals& refusals)
    : options_(std::move(options)),
      limits_(limits),
      refusals_(refusals),
      connects_(limits.connects_per_second, limits.connect_burst) {}

void WhepEndpoint::link(SoupServerMessage* message) {
  if (!options_.ice.empty()) set_header(message, "Link", options_.ice.links(seconds_now()));
}

void WhepEndpoint::options(SoupServerMessage* message, bool trusted) {
  set_header(message, "Accept-Post", "application/sdp");
  if (trusted) link(message);
  allow(message, kMethods);
}

void WhepEndpoint::refuse_offer(SoupServerMessage* message, const Client& client, const std::string& why) {
  refusals_.answer(message, client.address, {SOUP_STATUS_BAD_REQUEST, "offer", why.c_str()});
}

std::optional<ViewParams> WhepEndpoint::view_params(SoupServerMessage* message, const Client& client,
                                                    GHashTable* query) {
  const auto picture = view_size(value_of(query, "width"), value_of(query, "height"), limits_);
  if (!picture) return refuse_offer(message, client, "width and height must be pixels"), std::nullopt;
  const auto distance = eye_distance(value_of(query, "eye-distance"));
  if (!distance) return refuse_offer(message, client, "eye-distance must be metres"), std::nullopt;
  ViewParams view_params{picture->width, picture->height, *distance, ""};
  if (const char* name = value_of(query, "path")) {
    const auto found = options_.paths.find(name);
    if (found == options_.paths.end()) return refusals_.answer(message, client.address, refusal::kPath), std::nullopt;
    view_params.path = found->second.file;
    view_params.width = found->second.width;
    view_params.height = found->second.height;
  }
  return view_params;
}

bool WhepEndpoint::seat(SoupServerMessage* message, const Client& client, const ViewParams& view_params,
                        const char* ticket, Sessions& sessions) {
  const AdmissionControl::Answer answer = sessions.ask(subscriber(client.address), view_params, ticket ? ticket : "");
  if (answer.verdict == AdmissionControl::Answer::kAdmitted) return true;
  nlohmann::json more;
  if (answer.verdict == AdmissionControl::Answer::kAddress) {
    more["seats"] = sessions.seats(view_params).of_address();
    refusals_.answer(message, client.address, refusal::kAddress, more);
    return false;
  }
  more["waiting"] = sessions.seats(view_params).waiting();
  if (!view_params.is_shared() && !options_.paths.empty()) more["path"] = options_.paths.begin()->first;
  if (answer.place > 0) more["place"] = answer.place;
  if (answer.place > 0) more["ticket"] = answer.ticket;
  refusals_.answer(message, client.address, refusal::kFull, more);
  return false;
}

void WhepEndpoint::endpoint(SoupServerMessage* message, const Client& client, GHashTable* query, Sessions& sessions) {
  const std::string method = soup_server_message_get_method(message);
  set_header(message, "Accept-Post", "application/sdp");
  if (method != "POST") {
    set_header(message, "Allow", kMethods);
    return respond(message, SOUP_STATUS_METHOD_NOT_ALLOWED, "text/plain", "POST an offer\n");
  }
  const char* type = soup_message_headers_get_content_type(soup_server_message_get_request_headers(message), nullptr);
  if (g_strcmp0(type, "application/sdp") != 0) return refusals_.answer(message, client.address, refusal::kType);
  if (!connects_.take(subscriber(client.address), g_get_monotonic_time()))
    return refusals_.answer(message, client.address, refusal::kRate);
  const auto view_params = this->view_params(message, client, query);
  if (!view_params) return;

  SoupMessageBody* body = soup_server_message_get_request_body(message);
  g_autoptr(GBytes) bytes = soup_message_body_flatten(body);
  gsize size = 0;
  const char* data = static_cast<const char*>(g_bytes_get_data(bytes, &size));
  std::string reason;
  // If this server is behind a NAT, packets from a viewer or relay can arrive only after the server has sent a packet
  // to their address.
  std::set<std::string> known = options_.relays;
  if (!options_.ice.empty()) known.insert(client.address);
  auto offer = parse_offer(std::string(data ? data : "", size), can_encode(VideoCodec::kH264),
                           can_encode(VideoCodec::kVp8), known, &reason);
  if (!offer) return refuse_offer(message, client, reason);
  if (seat(message, client, *view_params, value_of(query, "ticket"), sessions))
    open(message, client, std::move(*offer), *view_params, sessions);
}

// Opens a viewer for the offer of a browser, and responds with the SDP answer. The browser may disconnect before the
// answer is ready.
void WhepEndpoint::open(SoupServerMessage* message, const Client& client, Offer offer, const ViewParams& view_params,
                        Sessions& sessions) {
  g_object_ref(message);
  soup_server_message_pause(message);
  auto name = std::make_shared<std::string>();
  auto waits = std::make_shared<bool>(true);
  using Waits = std::shared_ptr<bool>;
  g_signal_connect_data(
      message, "finished", G_CALLBACK(+[](SoupServerMessage*, gpointer data) { **static_cast<Waits*>(data) = false; }),
      new Waits(waits), [](gpointer data, GClosure*) { delete static_cast<Waits*>(data); }, GConnectFlags(0));
  const auto answer = [this, message, client, name, waits](const std::string& sdp, const std::string& problem) {
    if (*waits && sdp.empty() && problem == kOfferRejected) {
      refuse_offer(message, client, problem);
    } else if (*waits && sdp.empty()) {
      refusals_.answer(message, client.address, refusal::kFull);
    } else if (*waits) {
      set_header(message, "Location", client.prefix + "/whep/" + *name);
      link(message);
      respond(message, SOUP_STATUS_CREATED, "application/sdp", sdp);
    }
    if (*waits) soup_server_message_unpause(message);
    g_object_unref(message);
  };
  try {
    const Route route{options_.media_address, options_.ice.for_webrtcbin(seconds_now())};
    *name = sessions.open(subscriber(client.address), std::move(offer), view_params, route, answer);
  } catch (const Error& error) {
    say(std::string("a viewer cannot be opened: ") + error.what());
    refusals_.answer(message, client.address, refusal::kView);
    soup_server_message_unpause(message);
    g_object_unref(message);
  }
}

void WhepEndpoint::session(SoupServerMessage* message, const std::string& name, Sessions& sessions) {
  const std::string method = soup_server_message_get_method(message);
  if (method == "GET" || method == "HEAD") {
    const bool exists = sessions.has(name);
    return respond(message, exists ? SOUP_STATUS_NO_CONTENT : SOUP_STATUS_NOT_FOUND, "text/plain", "");
  }
  if (method != "DELETE") {
    set_header(message, "Allow", "GET, HEAD, DELETE, OPTIONS");
    return respond(message, SOUP_STATUS_METHOD_NOT_ALLOWED, "text/plain", "GET or DELETE only\n");
  }
  const bool found = sessions.close(name, "the browser leaves");
  respond(message, found ? SOUP_STATUS_OK : SOUP_STATUS_NOT_FOUND, "text/plain", found ? "" : "no such session\n");
}

HttpServer::HttpServer(const ServerOptions& options, const Limits& limits)
    : options_(options),
      limits_(limits),
      access_(options.token, options.origins, options.hosts),
      whep_(options.whep, limits, refusals_),
      wrong_tokens_(Limits::kWrongTokens, Limits::kWrongTokensAtOnce),
      certificate_(load_certificate(options)) {
  if (!is_loopback(options.address) && !certificate_ && !options.insecure)
    throw Error("--listen " + options.address +
                ": this address accepts connections from other machines, but HTTP is not encrypted; give "
                "--tls-certificate and --tls-key, or " +
                "give --insecure if the network is trusted");
  HttpListener::Settings settings{.name = "lf-serve",
                                  .caching = "no-cache",
                                  .max_body = Offer::kMaxBytes,
                                  .on_request = [this](SoupServerMessage* message, const std::string& path,
                                                       GHashTable* query) { handle(message, path, query); },
                                  .on_refusal =
                                      [this](SoupServerMessage* message, const HttpRefusal& refusal) {
                                        refusals_.answer(message, client_of(message).address, refusal);
                                      }};
  try {
    listener_ =
        std::make_unique<HttpListener>(options.address == "localhost" ? "127.0.0.1" : options.address, options.port,
                                       certificate_ ? certificate_->get() : nullptr, std::move(settings));
  } catch (const Error& error) {
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

// Renewal programs replace the two files in turn, so a key without its certificate may be temporary.
void HttpServer::renew_certificate() {
  try {
    if (!certificate_->reload()) return;
    listener_->set_certificate(certificate_->get());
    say("new connections use the new certificate in " + options_.certificate);
  } catch (const Error& error) {
    say(std::string("the new certificate is unusable, so the old one stays in use: ") + error.what());
  }
}

HttpServer::~HttpServer() {
  if (certificate_timer_) g_source_remove(certificate_timer_);
}

std::string HttpServer::url() const {
  const std::string host =
      options_.address.find(':') == std::string::npos ? options_.address : "[" + options_.address + "]";
  return (options_.certificate.empty() ? "http://" : "https://") + host + ":" + std::to_string(listener_->port()) + "/";
}

void HttpServer::serve(LightField& field, Sessions& sessions) {
  field_ = &field;
  sessions_ = &sessions;
}

void HttpServer::stop() {
  field_ = nullptr;
  sessions_ = nullptr;
}

WhepEndpoint::Client HttpServer::client_of(SoupServerMessage* message) const {
  const std::string peer = address_of(message);
  WhepEndpoint::Client client{client_address(peer, header(message, "X-Forwarded-For"), options_.proxies), ""};
  if (options_.proxies.contains(peer)) client.prefix = path_prefix(header(message, "X-Forwarded-Prefix"));
  return client;
}

void HttpServer::handle(SoupServerMessage* message, const std::string& path, GHashTable* query) {
  const std::string method = soup_server_message_get_method(message);
  if (path == "/healthz") return respond(message, SOUP_STATUS_OK, "text/plain", "ok\n");
  if (path == "/readyz")
    return respond(message, sessions_ ? SOUP_STATUS_OK : SOUP_STATUS_SERVICE_UNAVAILABLE, "text/plain",
                   sessions_ ? "ok\n" : "the cameras are being opened\n");
  const WhepEndpoint::Client client = client_of(message);
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
    return whep_.options(message, !access_.requires_token() || access_.has_token(header(message, "Authorization")));
  if (method == "OPTIONS") return allow(message, "GET, OPTIONS");
  if (data && method != "GET" && method != "HEAD") {
    set_header(message, "Allow", "GET, HEAD");
    return respond(message, SOUP_STATUS_METHOD_NOT_ALLOWED, "text/plain", "GET only\n");
  }
  if (!sessions_) return wait(message, client);
  serve(message, client, path, query);
}

void HttpServer::wait(SoupServerMessage* message, const WhepEndpoint::Client& client) {
  if (filming_progress_)
    refusals_.answer(message, client.address, refusal::kFilming, {{"progress", *filming_progress_}});
  else
    refusals_.answer(message, client.address, refusal::kStarting);
}

void HttpServer::serve(SoupServerMessage* message, const WhepEndpoint::Client& client, const std::string& path,
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

bool HttpServer::admit(SoupServerMessage* message, const WhepEndpoint::Client& client) {
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
  // Browsers send no token with CORS preflights.
  const bool asks = g_str_equal(soup_server_message_get_method(message), "OPTIONS");
  return (asks && !header(message, "Authorization")) || check_token(message, client);
}

// The rate limit applies to wrong tokens only, so an attacker cannot lock out clients with the correct token.
bool HttpServer::check_token(SoupServerMessage* message, const WhepEndpoint::Client& client) {
  if (!access_.requires_token()) return true;
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
  std::string policy =
      "default-src 'self'; img-src 'self' data:; object-src 'none'; base-uri 'none'; form-action 'none'; "
      "frame-ancestors 'self'";
  for (const std::string& origin : access_.origins())
    if (origin != "null") policy += " " + origin;
  if (!respond_with_page(message, path, "/index.html", policy)) return;
  // Pages of other sites may load the element itself. Access to streams is checked for each request.
  set_header(message, "Access-Control-Allow-Origin", "*");
  set_header(message, "Cross-Origin-Resource-Policy", "cross-origin");
}

std::string HttpServer::metrics() const {
  const ViewerCounters counters = sessions_->counters();
  std::ostringstream out;
  const auto put = [&out](const char* name, const char* type, const char* help, auto value) {
    out << "# HELP lightfield_" << name << ' ' << help << "\n# TYPE lightfield_" << name << ' ' << type
        << "\nlightfield_" << name << ' ' << value << '\n';
  };
  out << "# HELP lightfield_build_info Version of the program.\n# TYPE lightfield_build_info gauge\n"
         "lightfield_build_info{program=\"lf-serve\",version=\"" LF_VERSION "\"} 1\n";
  put("viewers", "gauge", "Viewers now.", sessions_->size());
  put("flights", "gauge", "Shared flights along camera paths now.", sessions_->flights());
  put("watchers", "gauge", "Viewers of shared flights now.", sessions_->watchers());
  put("viewers_total", "counter", "Admitted viewers.", sessions_->opened());
  put("pictures_total", "counter", "Pictures composed.", counters.pictures);
  put("incomplete_pictures_total", "counter", "Incomplete pictures.", counters.incomplete);
  put("camera_bytes_total", "counter", "Bytes of answers from the cameras.", field_->answer_bytes());
  put("composed_bytes_total", "counter", "Bytes of answers used in pictures.", counters.answer_bytes);
  put("video_bytes_total", "counter", "Bytes of RTP packets for browsers.", counters.video_bytes);
  put("surface_bytes_total", "counter", "Bytes of messages with surfaces for browsers.", counters.surface_bytes);
  put("refused_messages_total", "counter", "Data channel messages that were invalid or above the rate limit.",
      counters.refused_messages);
  out << "# HELP lightfield_flight_pictures_total Encoded pictures of shared flights.\n"
         "# TYPE lightfield_flight_pictures_total counter\n"
         "lightfield_flight_pictures_total{size=\"full\"} "
      << counters.encoded << "\nlightfield_flight_pictures_total{size=\"half\"} " << counters.encoded_half << '\n';
  put("resident_bytes", "gauge", "Memory of the process.", resident_bytes());
  put("connections", "gauge", "TCP connections now.", listener_->size());
  put("closed_connections_total", "counter", "TCP connections closed because they were too slow or too many.",
      listener_->closed());
  put("shed_step", "gauge", "Load reduction: 0 none, 1 and 2 fewer depth hypotheses, 3 half the rate, 4 half the size.",
      sessions_->load_shedding().step());
  put("waiting", "gauge", "Tickets in the queue for seats.", sessions_->seats({}).waiting());
  out << field_->picture_ages().text("lightfield_picture_age_seconds",
                                     "Time from the captured instant to its composed picture.");
  if (field_->is_local()) {
    const CameraStates cameras = field_->cameras();
    put("cameras", "gauge", "Cameras of the rig.", cameras.count);
    put("cameras_working", "gauge", "Cameras that are not lost.", cameras.working);
  } else {
    const std::vector<size_t> silent = field_->silent_nodes();
    out << "# HELP lightfield_node_silent Camera hosts that do not answer requests.\n"
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
