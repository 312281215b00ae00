// SPDX-License-Identifier: LGPL-2.1-or-later
#include "cameras/identify_server.h"

#include <nlohmann/json.hpp>
#include <optional>

#include "base/text.h"
#include "serve/http.h"

namespace lf::cameras {
namespace {

using lf::serve::header;
using lf::serve::respond;

constexpr size_t kLongestBody = 1000;

void respond_json(SoupServerMessage* message, guint status, const nlohmann::json& json) {
  respond(message, status, "application/json", json.dump());
}

}  // namespace

IdentifyServer::IdentifyServer(int port, Source source) : source_(std::move(source)), access_("", {}, {}) {
  lf::serve::HttpListener::Settings settings{
      .name = "lf-rig",
      .caching = "no-store",
      .max_body = kLongestBody,
      .on_request = [this](SoupServerMessage* message, const std::string& path, GHashTable*) { handle(message, path); },
      .on_refusal =
          [](SoupServerMessage* message, const lf::serve::HttpRefusal& refusal) {
            respond(message, refusal.status, "text/plain", std::string(refusal.title) + "\n");
          }};
  try {
    listener_ = std::make_unique<lf::serve::HttpListener>("127.0.0.1", port, nullptr, std::move(settings));
  } catch (const Error& error) {
    throw Error("port " + std::to_string(port) + ": " + error.what());
  }
}

std::string IdentifyServer::url() const { return "http://127.0.0.1:" + std::to_string(listener_->port()) + "/"; }

// A browser on this machine may also show pages of other sites. They must neither see the cameras nor change the rig.
void IdentifyServer::handle(SoupServerMessage* message, const std::string& path) {
  const char* host = header(message, "Host");
  const char* origin = header(message, "Origin");
  const bool of_cameras = path.starts_with("/mosaic.") || path == "/swap";  // other sites may link to the page itself
  if (!access_.allows_host(host) || !access_.allows_origin(origin, host) ||
      (of_cameras && !access_.allows_site(header(message, "Sec-Fetch-Site"), origin, host)))
    return respond(message, SOUP_STATUS_FORBIDDEN, "text/plain", "pages of other sites are not allowed\n");
  const std::string method = soup_server_message_get_method(message);
  if (path == "/swap" && method == "POST" && source_.swap) return swap(message);
  if (method != "GET" && method != "HEAD")
    return respond(message, SOUP_STATUS_METHOD_NOT_ALLOWED, "text/plain", "GET only\n");
  if (path == "/mosaic.json") return respond(message, SOUP_STATUS_OK, "application/json", source_.state());
  if (path == "/mosaic.jpg") {
    try {
      const std::vector<uint8_t> jpeg = source_.jpeg();
      return respond(message, SOUP_STATUS_OK, "image/jpeg", std::string(jpeg.begin(), jpeg.end()));
    } catch (const Error& error) {
      return respond(message, SOUP_STATUS_INTERNAL_SERVER_ERROR, "text/plain", std::string(error.what()) + "\n");
    }
  }
  lf::serve::respond_with_page(message, path, "/cameras.html",
                               "default-src 'self'; frame-ancestors 'none'; base-uri 'none'");
}

// Requests must be JSON, because pages of other sites cannot send JSON without a CORS preflight.
void IdentifyServer::swap(SoupServerMessage* message) {
  const char* type = header(message, "Content-Type");
  SoupMessageBody* body = soup_server_message_get_request_body(message);
  if (!type || !std::string(type).starts_with("application/json"))
    return respond_json(message, SOUP_STATUS_UNSUPPORTED_MEDIA_TYPE, {{"problem", "must be application/json"}});
  const auto json = nlohmann::json::parse(body->data, body->data + body->length, nullptr, false);
  const auto id = [&](const char* key) -> std::optional<uint32_t> {
    if (!json.is_object() || !json.contains(key) || !json[key].is_number_unsigned() || json[key] > UINT32_MAX)
      return std::nullopt;
    return json[key].get<uint32_t>();
  };
  const auto a = id("a"), b = id("b");
  if (!a || !b) return respond_json(message, SOUP_STATUS_BAD_REQUEST, {{"problem", "a and b must be ids of cameras"}});
  const std::string problem = source_.swap(*a, *b);
  respond_json(message, problem.empty() ? SOUP_STATUS_OK : SOUP_STATUS_CONFLICT, {{"problem", problem}});
}

}  // namespace lf::cameras
