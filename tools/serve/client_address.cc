// SPDX-License-Identifier: LGPL-2.1-or-later
#include "client_address.h"

#include <gio/gio.h>

#include <algorithm>
#include <cstring>
#include <string_view>

#include "base/error.h"

namespace lf::serve {
namespace {

std::string trimmed(std::string_view text) {
  while (text.starts_with(' ')) text.remove_prefix(1);
  while (text.ends_with(' ')) text.remove_suffix(1);
  return std::string(text);
}

std::string text_of(GInetAddress* address) {
  g_autofree gchar* text = g_inet_address_to_string(address);
  return text;
}

}  // namespace

std::string plain_address(const std::string& address) {
  g_autoptr(GInetAddress) parsed = g_inet_address_new_from_string(address.c_str());
  if (!parsed) return "";
  constexpr guint8 kMapped[] = {0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0xff, 0xff};
  const guint8* bytes = g_inet_address_to_bytes(parsed);
  if (g_inet_address_get_family(parsed) == G_SOCKET_FAMILY_IPV4 || std::memcmp(bytes, kMapped, sizeof kMapped) != 0)
    return text_of(parsed);
  g_autoptr(GInetAddress) mapped = g_inet_address_new_from_bytes(bytes + sizeof kMapped, G_SOCKET_FAMILY_IPV4);
  return text_of(mapped);
}

std::set<std::string> proxy_addresses(const std::string& proxy) {
  if (g_ascii_strcasecmp(proxy.c_str(), "localhost") == 0) return {"127.0.0.1", "::1"};
  const std::string address = plain_address(proxy);
  if (address.empty()) throw Error("--proxy " + proxy + ": must be an IP address or localhost");
  return {address};
}

// Only own addresses can be bound to.
bool is_local_address(const std::string& address) {
  g_autoptr(GSocketAddress) bound = g_inet_socket_address_new_from_string(address.c_str(), 0);
  if (!bound) return false;
  g_autoptr(GSocket) socket =
      g_socket_new(g_socket_address_get_family(bound), G_SOCKET_TYPE_DATAGRAM, G_SOCKET_PROTOCOL_UDP, nullptr);
  return socket && g_socket_bind(socket, bound, FALSE, nullptr);
}

std::string subscriber(const std::string& address) {
  const std::string plain = plain_address(address);
  g_autoptr(GInetAddress) parsed = g_inet_address_new_from_string(plain.c_str());
  if (!parsed || g_inet_address_get_family(parsed) == G_SOCKET_FAMILY_IPV4 || g_inet_address_get_is_loopback(parsed))
    return plain;
  constexpr gsize kWhole = 16, kNetwork = 8;
  guint8 bytes[kWhole];
  std::memcpy(bytes, g_inet_address_to_bytes(parsed), kWhole);
  std::fill(bytes + kNetwork, bytes + kWhole, guint8{0});
  g_autoptr(GInetAddress) network = g_inet_address_new_from_bytes(bytes, G_SOCKET_FAMILY_IPV6);
  return text_of(network) + "/64";
}

std::string client_address(const std::string& peer, const char* forwarded, const std::set<std::string>& proxies) {
  if (!forwarded || !proxies.contains(peer)) return peer;
  const std::string_view list = forwarded;
  const size_t comma = list.rfind(',');
  const std::string last = trimmed(comma == list.npos ? list : list.substr(comma + 1));
  const std::string plain = plain_address(last);
  return plain.empty() ? peer : plain;
}

std::string path_prefix(const char* forwarded) {
  std::string path = forwarded ? forwarded : "";
  while (path.ends_with('/')) path.pop_back();
  const auto plain = [](char c) { return g_ascii_isalnum(c) || std::strchr("/-._~", c); };
  constexpr size_t kLongest = 256;
  if (path.size() > kLongest || !path.starts_with('/') || path.starts_with("//") || !std::ranges::all_of(path, plain))
    return "";
  return path;
}

}  // namespace lf::serve
