// SPDX-License-Identifier: LGPL-2.1-or-later
#include "serve/http.h"

#include <algorithm>
#include <map>
#include <set>
#include <sstream>

#include <linux/tcp.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <nlohmann/json.hpp>

#include "base/text.h"
#include "serve/access.h"
#include "serve/process.h"

namespace lf::serve {
namespace {

constexpr const char* kReasons[] = {"address", "body", "filming",  "full",  "header",     "host", "offer", "origin",
                                    "path",    "rate", "starting", "token", "token-rate", "type", "view"};

// True if a security-relevant header occurs twice. A proxy and this server might use different copies.
bool is_ambiguous(SoupMessageHeaders* headers) {
  constexpr const char* kOnce[] = {"Authorization", "Content-Length", "Content-Type",  "Host",
                                   "Origin",        "Sec-Fetch-Mode", "Sec-Fetch-Site"};
  size_t counts[std::size(kOnce)] = {};
  SoupMessageHeadersIter iter;
  const char *name = nullptr, *value = nullptr;
  soup_message_headers_iter_init(&iter, headers);
  while (soup_message_headers_iter_next(&iter, &name, &value))
    for (size_t i = 0; i < std::size(kOnce); i++)
      if (g_ascii_strcasecmp(name, kOnce[i]) == 0 && ++counts[i] > 1) return true;
  return false;
}

// Returns the reason why a request must be refused before its body is read, or null. The body is then discarded.
const HttpRefusal* early_refusal(SoupServerMessage* message, size_t max_body) {
  SoupMessageHeaders* headers = soup_server_message_get_request_headers(message);
  const SoupEncoding encoding = soup_message_headers_get_encoding(headers);
  const bool has_length = encoding == SOUP_ENCODING_CONTENT_LENGTH;
  const HttpRefusal* reason = nullptr;
  if (is_ambiguous(headers))
    reason = &refusal::kHeader;
  else if (has_length && soup_message_headers_get_content_length(headers) > static_cast<goffset>(max_body))
    reason = &refusal::kBody;
  else if (!has_length && encoding != SOUP_ENCODING_NONE)
    reason = &refusal::kLength;
  if (reason) soup_message_body_set_accumulate(soup_server_message_get_request_body(message), FALSE);
  return reason;
}

constexpr guint kTickMs = 1000, kHandshakeTickMs = 100;

std::string name_of(GSocketAddress* address) {
  if (!address || !G_IS_INET_SOCKET_ADDRESS(address)) return "";
  GInetSocketAddress* inet = G_INET_SOCKET_ADDRESS(address);
  g_autofree gchar* text = g_inet_address_to_string(g_inet_socket_address_get_address(inet));
  return std::string(text) + " " + std::to_string(g_inet_socket_address_get_port(inet));
}

bool has_received(GSocketConnection* connection) {
  tcp_info info{};
  socklen_t size = sizeof info;
  const int file = g_socket_get_fd(g_socket_connection_get_socket(connection));
  return getsockopt(file, IPPROTO_TCP, TCP_INFO, &info, &size) == 0 && info.tcpi_bytes_received > 0;
}

// Makes close() reset the connection. After a normal close, a client with a closed TCP window would stay connected for
// minutes.
void cut_off(GSocket* socket) {
  const linger at_once{.l_onoff = 1, .l_linger = 0};
  setsockopt(g_socket_get_fd(socket), SOL_SOCKET, SO_LINGER, &at_once, sizeof at_once);
  g_socket_shutdown(socket, TRUE, TRUE, nullptr);
}

}  // namespace

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

bool respond_with_page(SoupServerMessage* message, const std::string& path, const char* index,
                       const std::string& policy) {
  const std::string name = "/lightfield" + (path == "/" ? index : path);
  g_autoptr(GBytes) bytes = g_resources_lookup_data(name.c_str(), G_RESOURCE_LOOKUP_FLAGS_NONE, nullptr);
  if (!bytes) {
    respond(message, SOUP_STATUS_NOT_FOUND, "text/plain", "not here\n");
    return false;
  }
  set_header(message, "Content-Security-Policy", policy);
  gsize size = 0;
  const char* data = static_cast<const char*>(g_bytes_get_data(bytes, &size));
  const char* type = path.ends_with(".js")    ? "text/javascript; charset=utf-8"
                     : path.ends_with(".css") ? "text/css; charset=utf-8"
                     : path.ends_with(".svg") ? "image/svg+xml"
                                              : "text/html; charset=utf-8";
  respond(message, SOUP_STATUS_OK, type, std::string(data, size));
  return true;
}

void allow(SoupServerMessage* message, const char* methods) {
  set_header(message, "Access-Control-Allow-Methods", methods);
  set_header(message, "Access-Control-Allow-Headers", "Authorization, Content-Type");
  soup_server_message_set_status(message, SOUP_STATUS_NO_CONTENT, nullptr);
}

void Refusals::answer(SoupServerMessage* message, const std::string& client, const HttpRefusal& refusal) {
  answer(message, client, refusal, nlohmann::json::object());
}

// Refusals with status 503 are not logged, because waiting clients repeat the request every second.
void Refusals::answer(SoupServerMessage* message, const std::string& client, const HttpRefusal& refusal,
                      const nlohmann::json& more) {
  count_[refusal.reason]++;
  if (refusal.status != SOUP_STATUS_SERVICE_UNAVAILABLE)
    say(client + ": " + std::to_string(refusal.status) + ", " + refusal.title);
  nlohmann::json body = more;
  body["title"] = refusal.title;
  body["status"] = refusal.status;
  body["reason"] = refusal.reason;
  if (refusal.retry_after > 0) set_header(message, "Retry-After", std::to_string(refusal.retry_after));
  respond(message, refusal.status, "application/problem+json", body.dump() + "\n");
}

std::string Refusals::metrics() const {
  std::ostringstream out;
  out << "# HELP lightfield_refused_total Requests that were refused.\n# TYPE lightfield_refused_total counter\n";
  for (const char* reason : kReasons) {
    const auto found = count_.find(reason);
    out << "lightfield_refused_total{reason=\"" << reason << "\"} " << (found == count_.end() ? 0 : found->second)
        << '\n';
  }
  return out.str();
}

// A TLS connection, from its first byte to the end of the handshake. Owns its members.
struct HttpListener::Handshake {
  HttpListener* owner;  // null after the owner was destroyed
  GSocketConnection* connection;
  Connection* state;  // in owner->open_ as long as `connection` is referenced
  GIOStream* tls = nullptr;
  GSource* first_byte = nullptr;
  bool has_begun = false;
  int64_t since = 0;  // g_get_monotonic_time() at the creation of `tls`
  GCancellable* cancellable = g_cancellable_new();

  Handshake(HttpListener* owner, GSocketConnection* connection, Connection* state)
      : owner(owner), connection(G_SOCKET_CONNECTION(g_object_ref(connection))), state(state) {}
  ~Handshake() {
    if (first_byte) {
      g_source_destroy(first_byte);
      g_source_unref(first_byte);
    }
    g_clear_object(&tls);
    g_object_unref(connection);
    g_object_unref(cancellable);
  }
  Handshake(const Handshake&) = delete;
};

HttpListener::HttpListener(const std::string& address, int port, GTlsCertificate* certificate, Settings settings)
    : settings_(std::move(settings)),
      server_(soup_server_new("server-header", settings_.name, nullptr)),
      certificate_(certificate ? G_TLS_CERTIFICATE(g_object_ref(certificate)) : nullptr),
      service_(g_socket_service_new()) {
  // GLib's default of 10 is too small, because a rejected client waits for a second before it tries again.
  g_socket_listener_set_backlog(G_SOCKET_LISTENER(service_), static_cast<int>(kMost));
  g_autoptr(GSocketAddress) bound = g_inet_socket_address_new_from_string(address.c_str(), static_cast<guint>(port));
  GSocketAddress* effective = nullptr;
  GError* error = nullptr;
  if (!bound || !g_socket_listener_add_address(G_SOCKET_LISTENER(service_), bound, G_SOCKET_TYPE_STREAM,
                                               G_SOCKET_PROTOCOL_TCP, nullptr, &effective, &error)) {
    const std::string text = address + ": " + (error ? error->message : "must be an IP address");
    g_clear_error(&error);
    g_object_unref(service_);
    g_clear_object(&certificate_);
    g_object_unref(server_);
    throw Error(text);
  }
  soup_server_add_early_handler(
      server_, nullptr,
      [](SoupServer*, SoupServerMessage* message, const char*, GHashTable*, gpointer data) {
        static_cast<HttpListener*>(data)->check_headers(message);
      },
      this, nullptr);
  soup_server_add_handler(
      server_, nullptr,
      [](SoupServer*, SoupServerMessage* message, const char* path, GHashTable* query, gpointer data) {
        auto* self = static_cast<HttpListener*>(data);
        self->note_request(message);
        self->settings_.on_request(message, path, query);
      },
      this, nullptr);
  port_ = g_inet_socket_address_get_port(G_INET_SOCKET_ADDRESS(effective));
  g_object_unref(effective);
  g_signal_connect(service_, "incoming",
                   G_CALLBACK(+[](GSocketService*, GSocketConnection* connection, GObject*, gpointer data) -> gboolean {
                     static_cast<HttpListener*>(data)->accept(connection);
                     return TRUE;
                   }),
                   this);
  timer_ = g_timeout_add(
      kTickMs,
      [](gpointer data) -> gboolean {
        static_cast<HttpListener*>(data)->tick();
        return G_SOURCE_CONTINUE;
      },
      this);
  g_socket_service_start(service_);
}

HttpListener::~HttpListener() {
  g_source_remove(timer_);
  if (handshake_timer_) g_source_remove(handshake_timer_);
  g_socket_service_stop(service_);
  g_socket_listener_close(G_SOCKET_LISTENER(service_));
  g_signal_handlers_disconnect_by_data(service_, this);
  g_object_unref(service_);
  for (Handshake* handshake : handshakes_) {
    handshake->owner = nullptr;
    g_cancellable_cancel(handshake->cancellable);
    if (!handshake->tls) delete handshake;
  }
  for (Connection& state : open_) g_weak_ref_clear(&state.connection);
  g_clear_object(&certificate_);
  soup_server_disconnect(server_);
  g_object_unref(server_);
}

void HttpListener::set_certificate(GTlsCertificate* certificate) { g_set_object(&certificate_, certificate); }

size_t HttpListener::size() {
  remove_closed();
  return open_.size();
}

void HttpListener::remove_closed() {
  for (auto i = open_.begin(); i != open_.end();) {
    g_autoptr(GObject) still = static_cast<GObject*>(g_weak_ref_get(&i->connection));
    if (still) {
      ++i;
    } else {
      g_weak_ref_clear(&i->connection);
      i = open_.erase(i);
    }
  }
}

size_t HttpListener::choose_victim(const std::vector<ConnectionInfo>& all, int64_t now) {
  std::map<std::string, size_t> counts;
  for (const ConnectionInfo& one : all) counts[one.subscriber]++;
  const auto most = std::ranges::max_element(counts, {}, [](const auto& entry) { return entry.second; });
  const bool greedy = most->second > kFairShare;
  // Returns the priority for closing: 0 for idle connections, 1 without a complete request, otherwise 2.
  const auto group_of = [now](const ConnectionInfo& one) {
    if (one.progress == Progress::kRequest) return 2;
    return one.progress == Progress::kNothing && now - one.since > kIdle ? 0 : 1;
  };
  size_t victim = all.size();
  for (size_t i = 0; i < all.size(); i++) {
    if (greedy && all[i].subscriber != most->first) continue;
    const auto rank = [&](const ConnectionInfo& one) { return std::pair(group_of(one), one.since); };
    if (victim == all.size() || rank(all[i]) < rank(all[victim])) victim = i;
  }
  return victim;
}

void HttpListener::make_room() {
  remove_closed();
  const int64_t now = g_get_monotonic_time();
  for (;;) {
    std::vector<ConnectionInfo> standings;
    std::vector<Connection*> of;
    for (Connection& state : open_) {
      if (state.ended) continue;
      g_autoptr(GSocketConnection) connection = static_cast<GSocketConnection*>(g_weak_ref_get(&state.connection));
      if (!connection) continue;
      const Progress progress = state.phase == Phase::kResponse ? Progress::kRequest
                                : has_received(connection)      ? Progress::kSome
                                                                : Progress::kNothing;
      standings.push_back({state.subscriber, state.since, progress});
      of.push_back(&state);
    }
    if (standings.size() < kMost) return;
    end(*of[choose_victim(standings, now)]);
  }
}

void HttpListener::accept(GSocketConnection* connection) {
  g_autoptr(GSocketAddress) remote = g_socket_connection_get_remote_address(connection, nullptr);
  if (!remote) return;
  const std::string name = name_of(remote);
  make_room();
  Connection& state = open_.emplace_back();
  g_weak_ref_init(&state.connection, connection);
  state.subscriber = subscriber(name.substr(0, name.find(' ')));
  state.remote = name;
  state.since = g_get_monotonic_time();
  state.phase = certificate_ ? Phase::kHandshake : Phase::kRequest;
  if (certificate_)
    await_hello(connection, state);
  else
    hand_over(connection, G_IO_STREAM(connection));
}

// GLib runs each handshake in a thread of a small pool, and a silent client must not occupy such a thread. The
// handshake therefore starts with the first byte.
void HttpListener::await_hello(GSocketConnection* connection, Connection& state) {
  auto* handshake = new Handshake(this, connection, &state);
  handshakes_.push_back(handshake);
  handshake->first_byte = g_socket_create_source(g_socket_connection_get_socket(connection), G_IO_IN, nullptr);
  const GSocketSourceFunc ready = [](GSocket*, GIOCondition, gpointer data) -> gboolean {
    auto* self = static_cast<Handshake*>(data);
    self->has_begun = true;
    self->owner->start_handshakes();
    return G_SOURCE_REMOVE;
  };
  g_source_set_callback(handshake->first_byte, G_SOURCE_FUNC(ready), handshake, nullptr);
  g_source_attach(handshake->first_byte, nullptr);
}

void HttpListener::start_handshakes() {
  handshakes_.remove_if([](Handshake* handshake) {
    if (handshake->tls || !handshake->state->ended) return false;
    delete handshake;
    return true;
  });
  const int64_t now = g_get_monotonic_time();
  std::map<std::string, size_t> counts;
  for (const Connection& state : open_) counts[state.subscriber]++;
  std::set<std::string> limited;
  for (;;) {
    size_t running = 0;
    Handshake *oldest = nullptr, *next = nullptr;
    for (Handshake* handshake : handshakes_) {
      const Connection* state = handshake->state;
      if (state->ended) continue;
      if (handshake->tls) {
        running++;
        if (!oldest || handshake->since < oldest->since) oldest = handshake;
      } else if (handshake->has_begun && !limited.contains(state->subscriber) &&
                 (!next || counts[state->subscriber] <= counts[next->state->subscriber])) {
        next = handshake;
      }
    }
    if (!next) break;
    if (running >= kMaxHandshakes) {
      if (now - oldest->since < kHandshakeSlice) break;
      end(*oldest->state);
    } else if (!handshake_limit_.take(next->state->subscriber, now)) {
      limited.insert(next->state->subscriber);
    } else if (!start_handshake(next)) {
      handshakes_.remove(next);
      delete next;
    }
  }
  const auto waits = [](const Handshake* handshake) { return handshake->has_begun && !handshake->tls; };
  if (handshake_timer_ || std::ranges::none_of(handshakes_, waits)) return;
  handshake_timer_ = g_timeout_add(
      kHandshakeTickMs,
      [](gpointer data) -> gboolean {
        auto* self = static_cast<HttpListener*>(data);
        self->handshake_timer_ = 0;
        self->start_handshakes();
        return G_SOURCE_REMOVE;
      },
      this);
}

// Returns false if the client has closed the connection.
bool HttpListener::start_handshake(Handshake* handshake) {
  if (g_socket_get_available_bytes(g_socket_connection_get_socket(handshake->connection)) <= 0) return false;
  handshake->since = g_get_monotonic_time();
  // Clients have no certificates, so the connection needs no database of trusted certificates. By default, GnuTLS would
  // load the system's database for each connection, which takes the main thread 10 ms.
  handshake->tls = G_IO_STREAM(g_initable_new(g_tls_backend_get_server_connection_type(g_tls_backend_get_default()),
                                              nullptr, nullptr, "base-io-stream", handshake->connection, "certificate",
                                              certificate_, "database", nullptr, nullptr));
  if (!handshake->tls) return false;
  g_tls_connection_set_require_close_notify(G_TLS_CONNECTION(handshake->tls), FALSE);
  g_tls_connection_handshake_async(
      G_TLS_CONNECTION(handshake->tls), G_PRIORITY_DEFAULT, handshake->cancellable,
      [](GObject* tls, GAsyncResult* result, gpointer data) {
        auto* self = static_cast<Handshake*>(data);
        const bool done = g_tls_connection_handshake_finish(G_TLS_CONNECTION(tls), result, nullptr);
        if (self->owner)
          self->owner->finish_handshake(self, done);
        else
          delete self;
      },
      handshake);
  return true;
}

void HttpListener::finish_handshake(Handshake* handshake, bool done) {
  handshakes_.remove(handshake);
  Connection* state = handshake->state;
  if (done && !state->ended) {
    state->phase = Phase::kRequest;
    state->since = g_get_monotonic_time();
    hand_over(handshake->connection, handshake->tls);
  }
  delete handshake;
  start_handshakes();
}

void HttpListener::hand_over(GSocketConnection* connection, GIOStream* stream) {
  g_autoptr(GSocketAddress) local = g_socket_connection_get_local_address(connection, nullptr);
  g_autoptr(GSocketAddress) remote = g_socket_connection_get_remote_address(connection, nullptr);
  if (local && remote) soup_server_accept_iostream(server_, stream, local, remote, nullptr);
}

// libsoup or the handshake notices the end of the stream and releases the connection.
void HttpListener::end(Connection& state) {
  state.ended = true;
  g_autoptr(GSocketConnection) connection = static_cast<GSocketConnection*>(g_weak_ref_get(&state.connection));
  if (!connection) return;
  closed_++;
  g_socket_shutdown(g_socket_connection_get_socket(connection), TRUE, TRUE, nullptr);
  for (Handshake* handshake : handshakes_)
    if (handshake->connection == connection) g_cancellable_cancel(handshake->cancellable);
}

// Runs before the body is read, because pages of other sites may send a body of any size.
void HttpListener::check_headers(SoupServerMessage* message) {
  // Works around libsoup before 3.3, which leaks keep-alive connections that the client closes.
  set_header(message, "Connection", "close");
  set_header(message, "Cache-Control", settings_.caching);
  set_header(message, "X-Content-Type-Options", "nosniff");
  set_header(message, "Referrer-Policy", "no-referrer");
  // Pages of other sites may not embed a response. Allowed origins read it through CORS.
  set_header(message, "Cross-Origin-Resource-Policy", "same-origin");
  // libsoup would send the body once per requested range, and a request may have thousands of ranges.
  soup_message_headers_remove(soup_server_message_get_request_headers(message), "Range");
  const HttpRefusal* const reason = early_refusal(message, settings_.max_body);
  if (!reason) return;
  note_request(message);
  limit_body(message);
  settings_.on_refusal(message, *reason);
}

void HttpListener::note_request(SoupServerMessage* message) {
  const std::string name = name_of(soup_server_message_get_remote_address(message));
  for (Connection& state : open_)
    if (state.remote == name) {
      state.phase = Phase::kResponse;
      state.since = g_get_monotonic_time();
    }
}

// libsoup reads the body of a refused request to its end before it responds, and a body without a length may never end.
// The connection is therefore closed after kRefusedBody bytes.
void HttpListener::limit_body(SoupServerMessage* message) {
  SoupMessageHeaders* headers = soup_server_message_get_request_headers(message);
  if (soup_message_headers_get_encoding(headers) == SOUP_ENCODING_CONTENT_LENGTH) return;
  const std::string name = name_of(soup_server_message_get_remote_address(message));
  const auto state = std::ranges::find(open_, name, &Connection::remote);
  if (state == open_.end()) return;
  struct Body {
    GWeakRef connection;
    size_t received = 0;
    explicit Body(GObject* object) { g_weak_ref_init(&connection, object); }
    ~Body() { g_weak_ref_clear(&connection); }
    Body(const Body&) = delete;
  };
  g_autoptr(GObject) connection = static_cast<GObject*>(g_weak_ref_get(&state->connection));
  g_signal_connect_data(
      message, "got-chunk", G_CALLBACK(+[](SoupServerMessage*, GBytes* chunk, gpointer data) {
        auto* body = static_cast<Body*>(data);
        body->received += g_bytes_get_size(chunk);
        if (body->received <= kRefusedBody) return;
        g_autoptr(GSocketConnection) connection = static_cast<GSocketConnection*>(g_weak_ref_get(&body->connection));
        if (connection) cut_off(g_socket_connection_get_socket(connection));
      }),
      new Body(connection), [](gpointer data, GClosure*) { delete static_cast<Body*>(data); },
      static_cast<GConnectFlags>(0));
}

void HttpListener::tick() {
  remove_closed();
  const int64_t now = g_get_monotonic_time();
  for (Connection& state : open_) {
    const int64_t most = state.phase == Phase::kResponse  ? kResponse
                         : state.phase == Phase::kRequest ? kRequest
                                                          : kHandshake;
    if (!state.ended && now - state.since > most * G_USEC_PER_SEC) end(state);
  }
  if (!handshakes_.empty()) start_handshakes();
}

}  // namespace lf::serve
