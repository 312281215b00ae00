// SPDX-License-Identifier: LGPL-2.1-or-later
#include "whep.h"

#include <memory>
#include <nlohmann/json.hpp>
#include <optional>

#include "base/error.h"
#include "client_address.h"
#include "encoder.h"
#include "log.h"

namespace lf::serve {
namespace {

constexpr char kMethods[] = "POST, DELETE, OPTIONS";

int64_t seconds_now() { return g_get_real_time() / G_USEC_PER_SEC; }

const char* value_of(GHashTable* query, const char* name) {
  return query ? static_cast<const char*>(g_hash_table_lookup(query, name)) : nullptr;
}

}  // namespace

Whep::Whep(Options options, const Limits& limits, Refusals& refusals)
    : options_(std::move(options)),
      limits_(limits),
      refusals_(refusals),
      connects_(limits.connects_per_second, limits.connect_burst) {}

void Whep::link(SoupServerMessage* message) {
  if (!options_.ice.empty()) set_header(message, "Link", options_.ice.links(seconds_now()));
}

// Credentials are for those who may watch.
void Whep::options(SoupServerMessage* message, bool trusted) {
  set_header(message, "Accept-Post", "application/sdp");
  if (trusted) link(message);
  allow(message, kMethods);
}

void Whep::refuse_offer(SoupServerMessage* message, const Client& client, const std::string& why) {
  refusals_.answer(message, client.address, {SOUP_STATUS_BAD_REQUEST, "offer", why.c_str()});
}

std::optional<Wish> Whep::wish(SoupServerMessage* message, const Client& client, GHashTable* query) {
  const auto picture = view_size(value_of(query, "width"), value_of(query, "height"), limits_);
  if (!picture) return refuse_offer(message, client, "width and height must be pixels"), std::nullopt;
  const auto distance = eye_distance(value_of(query, "eye-distance"));
  if (!distance) return refuse_offer(message, client, "eye-distance must be metres"), std::nullopt;
  Wish wish{picture->width, picture->height, *distance, ""};
  if (const char* name = value_of(query, "path")) {
    const auto found = options_.paths.find(name);
    if (found == options_.paths.end()) return refusals_.answer(message, client.address, refusal::kPath), std::nullopt;
    wish.path = found->second;
  }
  return wish;
}

bool Whep::seat(SoupServerMessage* message, const Client& client, const Wish& wish, const char* ticket,
                Sessions& sessions) {
  const Seats::Answer answer = sessions.ask(subscriber(client.address), wish, ticket ? ticket : "");
  if (answer.verdict == Seats::Answer::kSeat) return true;
  nlohmann::json more;
  if (answer.verdict == Seats::Answer::kAddress) {
    more["seats"] = sessions.seats().of_address();
    refusals_.answer(message, client.address, refusal::kAddress, more);
    return false;
  }
  more["waiting"] = sessions.seats().waiting();
  if (answer.place > 0) more["place"] = answer.place;
  if (answer.place > 0) more["ticket"] = answer.ticket;
  refusals_.answer(message, client.address, refusal::kFull, more);
  return false;
}

void Whep::endpoint(SoupServerMessage* message, const Client& client, GHashTable* query, Sessions& sessions) {
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
  const auto wish = this->wish(message, client, query);
  if (!wish) return;

  SoupMessageBody* body = soup_server_message_get_request_body(message);
  g_autoptr(GBytes) bytes = soup_message_body_flatten(body);
  gsize size = 0;
  const char* data = static_cast<const char*>(g_bytes_get_data(bytes, &size));
  std::string reason;
  // Behind address translation packets must be sent to where a viewer's come from, or its relay's, before they can
  // come.
  std::set<std::string> known = options_.relays;
  if (!options_.ice.empty()) known.insert(client.address);
  auto offer = parse_offer(std::string(data ? data : "", size), can_encode(VideoCodec::kH264),
                           can_encode(VideoCodec::kVp8), known, &reason);
  if (!offer) return refuse_offer(message, client, reason);
  if (seat(message, client, *wish, value_of(query, "ticket"), sessions))
    open(message, client, std::move(*offer), *wish, sessions);
}

// The browser may have gone when the answer is there: nobody waits for it then.
void Whep::open(SoupServerMessage* message, const Client& client, Offer offer, const Wish& wish, Sessions& sessions) {
  g_object_ref(message);
  soup_server_message_pause(message);
  auto name = std::make_shared<std::string>();
  auto waits = std::make_shared<bool>(true);
  using Waits = std::shared_ptr<bool>;
  g_signal_connect_data(
      message, "finished", G_CALLBACK(+[](SoupServerMessage*, gpointer data) { **static_cast<Waits*>(data) = false; }),
      new Waits(waits), [](gpointer data, GClosure*) { delete static_cast<Waits*>(data); }, GConnectFlags(0));
  const auto answer = [this, message, client, name, waits](const std::string& sdp, const std::string& problem) {
    if (*waits && sdp.empty() && problem == kUnanswerable) {
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
    Route route{options_.media_address, options_.ice.for_webrtcbin(seconds_now())};
    *name = sessions.open(subscriber(client.address), std::move(offer), wish, std::move(route), answer);
  } catch (const Error& error) {
    say(std::string("a view can't be opened: ") + error.what());
    refusals_.answer(message, client.address, refusal::kView);
    soup_server_message_unpause(message);
    g_object_unref(message);
  }
}

void Whep::session(SoupServerMessage* message, const std::string& name, Sessions& sessions) {
  if (!g_str_equal(soup_server_message_get_method(message), "DELETE")) {
    set_header(message, "Allow", "DELETE, OPTIONS");
    return respond(message, SOUP_STATUS_METHOD_NOT_ALLOWED, "text/plain", "DELETE only\n");
  }
  const bool found = sessions.close(name, "the browser leaves");
  respond(message, found ? SOUP_STATUS_OK : SOUP_STATUS_NOT_FOUND, "text/plain", found ? "" : "no such session\n");
}

}  // namespace lf::serve
