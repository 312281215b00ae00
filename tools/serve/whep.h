// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <libsoup/soup.h>

#include <map>
#include <set>
#include <string>

#include "http_reply.h"
#include "ice_servers.h"
#include "rate_limit.h"
#include "sessions.h"

namespace lf::serve {

// The endpoint /whep and its sessions (draft-ietf-wish-whep; docs/web-interface.md), behind whoever has looked at
// origin and token. On the main thread alone.
class Whep {
 public:
  struct Options {
    std::map<std::string, std::string> paths;  // views.json files that viewers may have flown, by name
    IceServers ice;
    std::set<std::string> relays;  // addresses of relays, whose candidates are taken
    std::string media_address;     // the only address of this machine that video comes from, or ""
  };
  struct Client {
    std::string address;  // address of the client, as text
    std::string prefix;   // the path that a proxy has put before ours, or ""
  };

  Whep(Options options, const Limits& limits, Refusals& refusals);

  // Answers requests to /whep.
  void endpoint(SoupServerMessage* message, const Client& client, GHashTable* query, Sessions& sessions);
  // Answers requests to /whep/NAME.
  void session(SoupServerMessage* message, const std::string& name, Sessions& sessions);
  // Answers OPTIONS; `trusted`: the client has shown the token.
  void options(SoupServerMessage* message, bool trusted);

 private:
  void refuse_offer(SoupServerMessage* message, const Client& client, const std::string& why);
  // Nothing where it was refused.
  std::optional<Wish> wish(SoupServerMessage* message, const Client& client, GHashTable* query);
  bool seat(SoupServerMessage* message, const Client& client, const Wish& wish, const char* ticket, Sessions& sessions);
  void open(SoupServerMessage* message, const Client& client, Offer offer, const Wish& wish, Sessions& sessions);
  void link(SoupServerMessage* message);

  Options options_;
  Limits limits_;
  Refusals& refusals_;
  AddressLimit connects_;
};

}  // namespace lf::serve
