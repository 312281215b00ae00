// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <libsoup/soup.h>

#include <cstdint>
#include <map>
#include <nlohmann/json_fwd.hpp>
#include <string>

namespace lf::serve {

// A header of the request; null if there is none.
const char* header(SoupServerMessage* message, const char* name);
// Sets a header of the response.
void set_header(SoupServerMessage* message, const char* name, const std::string& value);
void respond(SoupServerMessage* message, guint status, const char* type, const std::string& body);
// Answers OPTIONS: what a page of another site may ask for.
void allow(SoupServerMessage* message, const char* methods);

// Why something is refused, as docs/web-interface.md has it.
struct Refusal {
  guint status;
  const char* reason;   // a name for programs, one of kReasons
  const char* title;    // a sentence for people
  int retry_after = 0;  // seconds; 0: never
};

namespace refusal {
inline constexpr Refusal kHeader{400, "header", "a header that may come once came twice"};
inline constexpr Refusal kHost{403, "host", "this server does not go by that name (--host)"};
inline constexpr Refusal kOrigin{403, "origin", "this origin may not watch (--origin)"};
inline constexpr Refusal kToken{401, "token", "the bearer token is missing or wrong"};
inline constexpr Refusal kTokenRate{429, "token-rate", "too many wrong tokens", 30};
inline constexpr Refusal kLength{411, "body", "the body has no length"};
inline constexpr Refusal kBody{413, "body", "the body is too long"};
inline constexpr Refusal kType{415, "type", "the offer must be application/sdp"};
inline constexpr Refusal kRate{429, "rate", "too many connects", 10};
inline constexpr Refusal kAddress{429, "address", "this address has all the views it may have", 5};
inline constexpr Refusal kFull{503, "full", "too many viewers", 1};
inline constexpr Refusal kFilming{503, "filming", "the scene is filmed for the first time", 1};
inline constexpr Refusal kStarting{503, "starting", "the cameras are being opened", 1};
inline constexpr Refusal kView{500, "view", "the server can't open a view: its log says why", 10};
inline constexpr Refusal kPath{404, "path", "there is no such path (--path)"};
}  // namespace refusal

// Call before a request's body is read. Returns why the request is refused: a header that decides who may ask came
// twice, or the body is longer than `most` bytes or has no length. Null if it is not; else the body is thrown away.
// Takes the header Range from the request: answers are whole.
const Refusal* refuse_early(SoupServerMessage* message, size_t most);
// Sets the headers that all responses have. `caching`: the value of Cache-Control.
void set_common_headers(SoupServerMessage* message, const char* caching);

// Answers with refusals, and counts them by their reason. On the main thread alone.
class Refusals {
 public:
  // `client`: for the log. `more`: members beside title, status and reason.
  void answer(SoupServerMessage* message, const std::string& client, const Refusal& refusal);
  void answer(SoupServerMessage* message, const std::string& client, const Refusal& refusal,
              const nlohmann::json& more);
  // How often each reason was given, in the format of Prometheus.
  std::string metrics() const;

 private:
  std::map<std::string, uint64_t> count_;
};

}  // namespace lf::serve
