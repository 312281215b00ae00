// SPDX-License-Identifier: LGPL-2.1-or-later
#include "http_reply.h"

#include <nlohmann/json.hpp>
#include <sstream>

#include "log.h"

namespace lf::serve {
namespace {

constexpr const char* kReasons[] = {"address", "body", "filming",  "full",  "host",       "offer", "origin",
                                    "path",    "rate", "starting", "token", "token-rate", "type"};

}  // namespace

const char* header(SoupServerMessage* message, const char* name) {
  return soup_message_headers_get_one(soup_server_message_get_request_headers(message), name);
}

void set_header(SoupServerMessage* message, const char* name, const std::string& value) {
  soup_message_headers_replace(soup_server_message_get_response_headers(message), name, value.c_str());
}

void respond(SoupServerMessage* message, guint status, const char* type, const std::string& body) {
  soup_server_message_set_status(message, status, nullptr);
  soup_server_message_set_response(message, type, SOUP_MEMORY_COPY, body.data(), body.size());
}

const Refusal* refuse_body(SoupServerMessage* message, size_t most) {
  SoupMessageHeaders* headers = soup_server_message_get_request_headers(message);
  const SoupEncoding encoding = soup_message_headers_get_encoding(headers);
  const bool has_length = encoding == SOUP_ENCODING_CONTENT_LENGTH;
  const bool too_long = has_length && soup_message_headers_get_content_length(headers) > static_cast<goffset>(most);
  if (!too_long && (has_length || encoding == SOUP_ENCODING_NONE)) return nullptr;
  soup_message_body_set_accumulate(soup_server_message_get_request_body(message), FALSE);
  return too_long ? &refusal::kBody : &refusal::kLength;
}

void allow(SoupServerMessage* message, const char* methods) {
  set_header(message, "Access-Control-Allow-Methods", methods);
  set_header(message, "Access-Control-Allow-Headers", "Authorization, Content-Type");
  soup_server_message_set_status(message, SOUP_STATUS_NO_CONTENT, nullptr);
}

void Refusals::answer(SoupServerMessage* message, const std::string& client, const Refusal& refusal) {
  answer(message, client, refusal, nlohmann::json::object());
}

// Those that ask again every second are not told of.
void Refusals::answer(SoupServerMessage* message, const std::string& client, const Refusal& refusal,
                      const nlohmann::json& more) {
  count_[refusal.reason]++;
  if (refusal.status != SOUP_STATUS_SERVICE_UNAVAILABLE)
    say(client + ": " + std::to_string(refusal.status) + ", " + refusal.title);
  nlohmann::json body = more;
  body["title"] = refusal.title;
  body["status"] = refusal.status;
  body["reason"] = refusal.reason;
  if (refusal.retry_after > 0) set_header(message, "Retry-After", std::to_string(refusal.retry_after));
  respond(message, refusal.status, "application/problem+json", body.dump() + "\n");
}

std::string Refusals::metrics() const {
  std::ostringstream out;
  out << "# HELP lightfield_refused_total Requests that were refused.\n# TYPE lightfield_refused_total counter\n";
  for (const char* reason : kReasons) {
    const auto found = count_.find(reason);
    out << "lightfield_refused_total{reason=\"" << reason << "\"} " << (found == count_.end() ? 0 : found->second)
        << '\n';
  }
  return out.str();
}

}  // namespace lf::serve
