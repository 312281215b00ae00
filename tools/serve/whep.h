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
    std::set<std::string> relays;  // of these
    std::string media_address;     // the only one that video comes from, or ""
  };
  struct Client {
    std::string address;  // as text
    std::string prefix;   // that a proxy has put before our paths, or ""
  };

  Whep(Options options, const Limits& limits, Refusals& refusals);

  // To /whep.
  void endpoint(SoupServerMessage* message, const Client& client, GHashTable* query, Sessions& sessions);
  // To /whep/NAME.
  void session(SoupServerMessage* message, const std::string& name, Sessions& sessions);
  // To OPTIONS; `trusted`: it has shown the token.
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
