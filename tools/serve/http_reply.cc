// SPDX-License-Identifier: LGPL-2.1-or-later
#include "http_reply.h"

#include <nlohmann/json.hpp>
#include <sstream>

#include "log.h"

namespace lf::serve {
namespace {

constexpr const char* kReasons[] = {"address", "body", "filming",  "full",  "header",     "host", "offer", "origin",
                                    "path",    "rate", "starting", "token", "token-rate", "type", "view"};

// Whether a header that decides who may ask came twice. Programs differ in which of the two they believe.
bool is_ambiguous(SoupMessageHeaders* headers) {
  constexpr const char* kOnce[] = {"Authorization", "Content-Length", "Content-Type",  "Host",
                                   "Origin",        "Sec-Fetch-Mode", "Sec-Fetch-Site"};
  size_t counts[std::size(kOnce)] = {};
  SoupMessageHeadersIter iter;
  const char *name = nullptr, *value = nullptr;
  soup_message_headers_iter_init(&iter, headers);
  while (soup_message_headers_iter_next(&iter, &name, &value))
    for (size_t i = 0; i < std::size(kOnce); i++)
      if (g_ascii_strcasecmp(name, kOnce[i]) == 0 && ++counts[i] > 1) return true;
  return false;
}

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

void set_common_headers(SoupServerMessage* message, const char* caching) {
  // libsoup before 3.3 never closes a connection that waits for another request when the client has closed it.
  set_header(message, "Connection", "close");
  set_header(message, "Cache-Control", caching);
  set_header(message, "X-Content-Type-Options", "nosniff");
  set_header(message, "Referrer-Policy", "no-referrer");
  // No page of another site may embed a response. Allowed origins read it by CORS.
  set_header(message, "Cross-Origin-Resource-Policy", "same-origin");
}

const Refusal* refuse_early(SoupServerMessage* message, size_t most) {
  SoupMessageHeaders* headers = soup_server_message_get_request_headers(message);
  // libsoup sends the body once for each range, and a request may have thousands. Our responses need no ranges.
  soup_message_headers_remove(headers, "Range");
  if (is_ambiguous(headers)) {
    soup_message_body_set_accumulate(soup_server_message_get_request_body(message), FALSE);
    return &refusal::kHeader;
  }
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
