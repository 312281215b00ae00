// SPDX-License-Identifier: LGPL-2.1-or-later
#include "serve/access.h"

#include <algorithm>
#include <array>
#include <cstring>
#include <string_view>

#include <gio/gio.h>

#include "base/text.h"

namespace lf::serve {
namespace {

constexpr size_t kDigestBytes = 32;

std::array<guint8, kDigestBytes> sha256(std::string_view text) {
  GChecksum* checksum = g_checksum_new(G_CHECKSUM_SHA256);
  g_checksum_update(checksum, reinterpret_cast<const guchar*>(text.data()), static_cast<gssize>(text.size()));
  std::array<guint8, kDigestBytes> digest;
  gsize size = digest.size();
  g_checksum_get_digest(checksum, digest.data(), &size);
  g_checksum_free(checksum);
  return digest;
}

std::string name_of(std::string_view host) {
  if (host.starts_with('[')) return std::string(host.substr(1, host.find(']') == host.npos ? 0 : host.find(']') - 1));
  return std::string(host.substr(0, host.find(':')));
}

std::string lower(std::string_view text) {
  g_autofree gchar* result = g_ascii_strdown(text.data(), static_cast<gssize>(text.size()));
  return result;
}

bool is_scheme_character(char c) { return g_ascii_isalnum(c) || c == '-' || c == '+'; }

bool is_host_name(const std::string& name) {
  return !name.empty() &&
         std::ranges::all_of(name, [](char c) { return g_ascii_isalnum(c) || (c && std::strchr(".-_:", c)); });
}

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

bool is_same_secret(std::string_view given, std::string_view secret) {
  const auto a = sha256(given), b = sha256(secret);
  unsigned different = 0;
  for (size_t i = 0; i < kDigestBytes; i++) different |= a[i] ^ b[i];
  return different == 0;
}

bool is_loopback(const std::string& address) {
  if (g_ascii_strcasecmp(address.c_str(), "localhost") == 0) return true;
  g_autoptr(GInetAddress) parsed = g_inet_address_new_from_string(address.c_str());
  return parsed && g_inet_address_get_is_loopback(parsed);
}

std::string normal_origin(const std::string& text) {
  if (text == "null" || text == "*") return text;
  std::string origin = lower(text);
  if (origin.ends_with('/')) origin.pop_back();
  const size_t scheme = origin.find("://");
  const std::string place = scheme == origin.npos ? "" : origin.substr(scheme + 3), name = name_of(place);
  const std::string host = place.starts_with('[') ? '[' + name + ']' : name;
  std::string_view port = std::string_view(place).substr(std::min(place.size(), host.size()));
  const bool has_port =
      port.starts_with(':') && port.size() > 1 && port.find_first_not_of("0123456789", 1) == port.npos;
  if (scheme == 0 || !is_host_name(name) || !place.starts_with(host) || (!port.empty() && !has_port) ||
      !std::ranges::all_of(origin.substr(0, std::min(scheme, origin.size())), is_scheme_character))
    throw Error("--origin " + text +
                ": must be an origin such as https://example.org or https://example.org:8443, null, or *");
  if ((origin.starts_with("http://") && port == ":80") || (origin.starts_with("https://") && port == ":443"))
    origin.resize(origin.size() - port.size());
  return origin;
}

std::string normal_host(const std::string& text) {
  const std::string name = lower(name_of(text));
  if (text.find('/') != text.npos || name.find(':') != name.npos || !is_host_name(name))
    throw Error("--host " + text + ": must be a host name, such as example.org");
  return name;
}

Access::Access(std::string token, const std::set<std::string>& origins, const std::set<std::string>& hosts)
    : token_(std::move(token)) {
  for (const std::string& origin : origins) origins_.insert(normal_origin(origin));
  for (const std::string& host : hosts) names_.insert(normal_host(host));
  hosts_ = names_;
  const std::string machine = lower(g_get_host_name());
  hosts_.insert({"localhost", machine, machine + ".local"});
}

bool Access::has_token(const char* authorization) const {
  if (token_.empty()) return true;
  constexpr std::string_view kScheme = "Bearer ";
  const std::string_view given = authorization ? authorization : "";
  if (given.size() < kScheme.size() || g_ascii_strncasecmp(given.data(), kScheme.data(), kScheme.size()) != 0)
    return false;
  return is_same_secret(given.substr(kScheme.size()), token_);
}

bool Access::allows_host(const char* host) const {
  if (!host) return false;
  const std::string name = lower(name_of(host));
  g_autoptr(GInetAddress) address = g_inet_address_new_from_string(name.c_str());
  return address || hosts_.contains(name);
}

bool Access::allows_site(const char* site, const char* origin, const char* host) const {
  const std::string_view given = site ? site : "none";
  if (given == "none" || given == "same-origin" || origins_.contains("*")) return true;
  return origin && allows_origin(origin, host);
}

bool Access::allows_origin(const char* origin, const char* host) const {
  if (!origin || origins_.contains("*") || origins_.contains(origin)) return true;
  const std::string_view text = origin;
  const size_t scheme = text.find("://");
  if (!host || scheme == text.npos) return false;
  const std::string page = lower(text.substr(scheme + 3));
  return page == lower(host) || names_.contains(name_of(page));
}

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

// A socket can be bound only to addresses of this machine.
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
