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
using lf::serve::set_header;

constexpr size_t kLongestBody = 1000;

void respond_json(SoupServerMessage* message, guint status, const nlohmann::json& json) {
  respond(message, status, "application/json", json.dump());
}

}  // namespace

IdentifyServer::IdentifyServer(int port, Source source)
    : source_(std::move(source)), access_("", {}, {}), server_(soup_server_new("server-header", "lf-rig", nullptr)) {
  soup_server_add_early_handler(
      server_, nullptr,
      [](SoupServer*, SoupServerMessage* message, const char*, GHashTable*, gpointer self) {
        static_cast<IdentifyServer*>(self)->begin(message);
      },
      this, nullptr);
  soup_server_add_handler(
      server_, nullptr,
      [](SoupServer*, SoupServerMessage* message, const char* path, GHashTable*, gpointer self) {
        static_cast<IdentifyServer*>(self)->handle(message, path);
      },
      this, nullptr);
  try {
    connections_ = std::make_unique<lf::serve::Connections>(server_, "127.0.0.1", port, nullptr);
  } catch (const Error& error) {
    g_object_unref(server_);
    throw Error("port " + std::to_string(port) + ": " + error.what());
  }
}

IdentifyServer::~IdentifyServer() {
  connections_.reset();
  soup_server_disconnect(server_);
  g_object_unref(server_);
}

std::string IdentifyServer::url() const { return "http://127.0.0.1:" + std::to_string(connections_->port()) + "/"; }

// Runs before the body is read, because pages of other sites may send a body of any size.
void IdentifyServer::begin(SoupServerMessage* message) {
  lf::serve::set_common_headers(message, "no-store");
  const lf::serve::HttpRefusal* const refusal = lf::serve::refuse_early(message, kLongestBody);
  if (!refusal) return;
  connections_->refused(message);
  respond(message, refusal->status, "text/plain", std::string(refusal->title) + "\n");
}

// A browser on this machine may also show pages of other sites. They must neither see the cameras nor change the rig.
void IdentifyServer::handle(SoupServerMessage* message, const std::string& path) {
  connections_->asked(message);
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
  const std::string name = "/lightfield" + (path == "/" ? "/cameras.html" : path);
  g_autoptr(GBytes) bytes = g_resources_lookup_data(name.c_str(), G_RESOURCE_LOOKUP_FLAGS_NONE, nullptr);
  if (!bytes) return respond(message, SOUP_STATUS_NOT_FOUND, "text/plain", "not here\n");
  set_header(message, "Content-Security-Policy", "default-src 'self'; frame-ancestors 'none'; base-uri 'none'");
  gsize size = 0;
  const char* data = static_cast<const char*>(g_bytes_get_data(bytes, &size));
  const char* type = path.ends_with(".js")    ? "text/javascript; charset=utf-8"
                     : path.ends_with(".css") ? "text/css; charset=utf-8"
                                              : "text/html; charset=utf-8";
  respond(message, SOUP_STATUS_OK, type, std::string(data, size));
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
