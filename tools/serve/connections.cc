// SPDX-License-Identifier: LGPL-2.1-or-later
#include "connections.h"

#include <algorithm>

#include "base/error.h"
#include "client_address.h"

namespace lf::serve {
namespace {

constexpr guint kTickMs = 1000;

// "ADDRESS PORT": of one connection, as long as it is open.
std::string name_of(GSocketAddress* address) {
  if (!address || !G_IS_INET_SOCKET_ADDRESS(address)) return "";
  GInetSocketAddress* inet = G_INET_SOCKET_ADDRESS(address);
  g_autofree gchar* text = g_inet_address_to_string(g_inet_socket_address_get_address(inet));
  return std::string(text) + " " + std::to_string(g_inet_socket_address_get_port(inet));
}

}  // namespace

Connections::Connections(SoupServer* server, const std::string& address, int port, GTlsCertificate* certificate)
    : server_(server), certificate_(certificate), service_(g_socket_service_new()) {
  g_autoptr(GSocketAddress) bound = g_inet_socket_address_new_from_string(address.c_str(), static_cast<guint>(port));
  GSocketAddress* effective = nullptr;
  GError* error = nullptr;
  if (!bound || !g_socket_listener_add_address(G_SOCKET_LISTENER(service_), bound, G_SOCKET_TYPE_STREAM,
                                               G_SOCKET_PROTOCOL_TCP, nullptr, &effective, &error)) {
    const std::string text = address + ": " + (error ? error->message : "must be an IP address");
    g_clear_error(&error);
    g_object_unref(service_);
    throw Error(text);
  }
  port_ = g_inet_socket_address_get_port(G_INET_SOCKET_ADDRESS(effective));
  g_object_unref(effective);
  g_signal_connect(service_, "incoming",
                   G_CALLBACK(+[](GSocketService*, GSocketConnection* connection, GObject*, gpointer data) -> gboolean {
                     static_cast<Connections*>(data)->accept(connection);
                     return TRUE;
                   }),
                   this);
  timer_ = g_timeout_add(
      kTickMs,
      [](gpointer data) -> gboolean {
        static_cast<Connections*>(data)->tick();
        return G_SOURCE_CONTINUE;
      },
      this);
  g_socket_service_start(service_);
}

Connections::~Connections() {
  g_source_remove(timer_);
  g_socket_service_stop(service_);
  g_socket_listener_close(G_SOCKET_LISTENER(service_));
  g_signal_handlers_disconnect_by_data(service_, this);
  g_object_unref(service_);
  for (const auto& [connection, state] : open_) g_object_weak_unref(G_OBJECT(connection), forget, this);
}

void Connections::accept(GSocketConnection* connection) {
  g_autoptr(GSocketAddress) local = g_socket_connection_get_local_address(connection, nullptr);
  g_autoptr(GSocketAddress) remote = g_socket_connection_get_remote_address(connection, nullptr);
  if (!local || !remote) return;  // gone already
  const std::string name = name_of(remote);
  if (open_.size() >= kMost) {
    std::map<std::string, size_t> of;
    for (const auto& [other, state] : open_) of[state.subscriber] += !state.ended;
    const auto most = std::ranges::max_element(of, {}, [](const auto& entry) { return entry.second; });
    GSocketConnection* oldest = nullptr;
    for (const auto& [other, state] : open_)
      if (!state.ended && state.subscriber == most->first && (!oldest || state.since < open_[oldest].since))
        oldest = other;
    if (oldest) end(oldest);
  }
  open_[connection] = {subscriber(name.substr(0, name.find(' '))), name, g_get_monotonic_time()};
  g_object_weak_ref(G_OBJECT(connection), forget, this);

  GIOStream* stream = G_IO_STREAM(g_object_ref(connection));
  if (certificate_) {
    GIOStream* inner = stream;
    stream = g_tls_server_connection_new(inner, certificate_, nullptr);
    g_object_unref(inner);
    if (!stream) return;
    g_tls_connection_set_require_close_notify(G_TLS_CONNECTION(stream), FALSE);
  }
  soup_server_accept_iostream(server_, stream, local, remote, nullptr);
  g_object_unref(stream);
}

void Connections::forget(gpointer data, GObject* connection) {
  static_cast<Connections*>(data)->open_.erase(reinterpret_cast<GSocketConnection*>(connection));
}

// libsoup sees the end of the stream and lets go of it.
void Connections::end(GSocketConnection* connection) {
  closed_++;
  open_[connection].ended = true;
  g_socket_shutdown(g_socket_connection_get_socket(connection), TRUE, TRUE, nullptr);
}

void Connections::asked(SoupServerMessage* message) {
  const std::string name = name_of(soup_server_message_get_remote_address(message));
  for (auto& [connection, state] : open_)
    if (state.remote == name) {
      state.asked = true;
      state.since = g_get_monotonic_time();
    }
}

void Connections::tick() {
  const int64_t now = g_get_monotonic_time();
  for (auto& [connection, state] : open_)
    if (!state.ended && now - state.since > (state.asked ? kResponse : kRequest) * G_USEC_PER_SEC) end(connection);
}

}  // namespace lf::serve
