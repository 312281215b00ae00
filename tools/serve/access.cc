// SPDX-License-Identifier: LGPL-2.1-or-later
#include "access.h"

#include <gio/gio.h>

#include <array>

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

// "example.org:8080" without the port, "[::1]:8080" without that and the brackets.
std::string name_of(std::string_view host) {
  if (host.starts_with('[')) return std::string(host.substr(1, host.find(']') == host.npos ? 0 : host.find(']') - 1));
  return std::string(host.substr(0, host.find(':')));
}

std::string lower(std::string_view text) {
  g_autofree gchar* result = g_ascii_strdown(text.data(), static_cast<gssize>(text.size()));
  return result;
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

Access::Access(std::string token, std::set<std::string> origins, std::set<std::string> hosts)
    : token_(std::move(token)), origins_(std::move(origins)) {
  for (const std::string& host : hosts) names_.insert(lower(host));
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

bool Access::allows_origin(const char* origin, const char* host) const {
  if (!origin || origins_.contains("*") || origins_.contains(origin)) return true;
  const std::string_view text = origin;
  const size_t scheme = text.find("://");
  if (!host || scheme == text.npos) return false;
  const std::string page = lower(text.substr(scheme + 3));
  return page == lower(host) || names_.contains(name_of(page));
}

}  // namespace lf::serve
