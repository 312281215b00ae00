// SPDX-License-Identifier: LGPL-2.1-or-later
#include "ice_servers.h"

#include <gio/gio.h>

#include <algorithm>
#include <cstring>
#include <sstream>

#include "base/error.h"
#include "log.h"

namespace lf::serve {
namespace {

// Names, addresses, "[::1]" and a port: nothing that could end a header.
bool is_host(const std::string& text) {
  return !text.empty() &&
         std::ranges::all_of(text, [](char c) { return g_ascii_isalnum(c) || (c && std::strchr(".-:[]", c)); });
}

bool is_word(const std::string& text) {
  return !text.empty() &&
         std::ranges::all_of(text, [](char c) { return c > ' ' && c <= '~' && c != '"' && c != '\\'; });
}

bool has_port(const std::string& host) {
  const size_t colon = host.rfind(':');
  return colon != host.npos && host.find(']', colon) == host.npos;
}

std::string hmac_sha1(const std::string& secret, const std::string& text) {
  GHmac* hmac = g_hmac_new(G_CHECKSUM_SHA1, reinterpret_cast<const guchar*>(secret.data()), secret.size());
  g_hmac_update(hmac, reinterpret_cast<const guchar*>(text.data()), static_cast<gssize>(text.size()));
  guint8 digest[20];
  gsize size = sizeof digest;
  g_hmac_get_digest(hmac, digest, &size);
  g_hmac_unref(hmac);
  g_autofree gchar* base64 = g_base64_encode(digest, size);
  return base64;
}

std::string escaped(const std::string& text) {
  g_autofree gchar* result = g_uri_escape_string(text.c_str(), nullptr, FALSE);
  return result;
}

}  // namespace

IceServers::IceServers(const std::vector<std::string>& uris, const std::string& credentials) {
  for (const std::string& uri : uris) {
    const size_t colon = uri.find(':'), question = uri.find('?');
    if (colon == uri.npos) throw Error("--ice-server " + uri + ": must be stun:HOST:PORT or turn:HOST:PORT");
    Server server{uri.substr(0, colon), uri.substr(colon + 1, question == uri.npos ? question : question - colon - 1),
                  question == uri.npos ? "" : uri.substr(question)};
    const bool turn = server.scheme == "turn" || server.scheme == "turns";
    const bool plain =
        server.query.empty() || (turn && (server.query == "?transport=udp" || server.query == "?transport=tcp"));
    if ((!turn && server.scheme != "stun") || !plain || !is_host(server.host))
      throw Error("--ice-server " + uri + ": must be stun:HOST:PORT or turn:HOST:PORT, with ?transport=udp or tcp");
    if (turn && credentials.empty()) throw Error("--ice-server " + uri + ": TURN needs --ice-credentials");
    servers_.push_back(std::move(server));
  }
  std::istringstream words(credentials);
  std::string first, second, third;
  words >> first >> second >> third;
  if (!third.empty() || (!first.empty() && !is_word(first)) || (!second.empty() && !is_word(second)))
    throw Error("--ice-credentials: must be a user and a password, or one secret, without quotes");
  if (second.empty())
    secret_ = first;
  else
    fixed_ = {first, second};
}

// Of a secret: the user is the time until which the password is good.
IceServers::Credentials IceServers::credentials(int64_t now) const {
  if (secret_.empty()) return fixed_;
  const std::string user = std::to_string(now + kLifetime);
  return {user, hmac_sha1(secret_, user)};
}

std::string IceServers::links(int64_t now) const {
  const auto [user, password] = credentials(now);
  std::string links;
  for (const auto& [scheme, host, query] : servers_) {
    links += (links.empty() ? "<" : ", <") + scheme + ":" + host + query + ">; rel=\"ice-server\"";
    if (scheme != "stun")
      links += "; username=\"" + user + "\"; credential=\"" + password + "\"; credential-type=\"password\"";
  }
  return links;
}

std::set<std::string> IceServers::relays() const {
  std::set<std::string> addresses;
  for (const auto& [scheme, host, query] : servers_) {
    if (scheme == "stun") continue;
    g_autoptr(GError) error = nullptr;
    g_autoptr(GResolver) resolver = g_resolver_get_default();
    g_autoptr(GSocketConnectable) place = g_network_address_parse(host.c_str(), 3478, &error);
    GList* found = place ? g_resolver_lookup_by_name(resolver, g_network_address_get_hostname(G_NETWORK_ADDRESS(place)),
                                                     nullptr, &error)
                         : nullptr;
    if (error) say("--ice-server " + scheme + ":" + host + query + ": " + error->message);
    for (GList* address = found; address; address = address->next) {
      g_autofree gchar* text = g_inet_address_to_string(G_INET_ADDRESS(address->data));
      addresses.insert(text);
    }
    g_resolver_free_addresses(found);
  }
  return addresses;
}

std::vector<std::string> IceServers::for_webrtcbin(int64_t now) const {
  const auto [user, password] = credentials(now);
  std::vector<std::string> uris;
  for (const auto& [scheme, host, query] : servers_) {
    const std::string place = host + (has_port(host) ? "" : scheme == "turns" ? ":5349" : ":3478");
    uris.push_back(scheme == "stun" ? "stun://" + place
                                    : scheme + "://" + escaped(user) + ":" + escaped(password) + "@" + place + query);
  }
  return uris;
}

}  // namespace lf::serve
