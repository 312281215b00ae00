// SPDX-License-Identifier: LGPL-2.1-or-later
// What a request says of who asks and for what: a line each of Host, Origin, Sec-Fetch-Site, Authorization,
// X-Forwarded-For, X-Forwarded-Prefix, and the query's width, height and eye-distance.
#include <algorithm>
#include <array>
#include <string>

#include "base/error.h"
#include "fuzz/fuzz.h"
#include "serve/access.h"
#include "serve/client_address.h"
#include "serve/limits.h"
#include "serve/log.h"

namespace {

using namespace lf;

// What is given out as an address or goes into a header has none of these.
bool is_plain(const std::string& text) {
  return std::ranges::all_of(text, [](char c) { return c > ' ' && c <= '~' && c != '"' && c != ','; });
}

// An operator's text in one form stays as it is, and matches itself.
void check_options(const std::string& text) {
  try {
    const std::string origin = serve::normal_origin(text);
    fuzz::require(serve::normal_origin(origin) == origin);
    fuzz::require(serve::Access("", {text}, {}).allows_origin(origin.c_str(), "127.0.0.1"));
  } catch (const Error&) {
  }
  try {
    const std::string host = serve::normal_host(text);
    fuzz::require(serve::normal_host(host) == host);
  } catch (const Error&) {
  }
}

}  // namespace

LF_FUZZ_TARGET(http)(const uint8_t* data, size_t size) {
  static const serve::Access access("sesame", {"https://example.org"}, {"cameras.example"});
  std::array<std::string, 9> lines;
  for (size_t i = 0, line = 0; i < size && line < lines.size(); i++) {
    if (data[i] == '\n')
      line++;
    else if (data[i] != 0)  // no header has one
      lines[line] += static_cast<char>(data[i]);
  }
  const auto& [host, origin, site, authorization, forwarded, prefix, width, height, distance] = lines;
  const bool allowed = access.allows_origin(origin.c_str(), host.c_str());
  if (access.allows_site(site.c_str(), origin.c_str(), host.c_str()) && site == "cross-site") fuzz::require(allowed);
  access.allows_host(host.c_str());
  fuzz::require(!access.has_token(authorization.c_str()) || authorization.substr(authorization.size() - 6) == "sesame");
  check_options(origin);
  check_options(host);
  const std::string client = serve::client_address("127.0.0.1", forwarded.c_str(), {"127.0.0.1"});
  fuzz::require(serve::plain_address(client) == client && is_plain(serve::subscriber(client)));
  fuzz::require(is_plain(serve::path_prefix(prefix.c_str())));
  const serve::Limits limits;
  if (const auto view = serve::view_size(width.c_str(), height.c_str(), limits)) {
    fuzz::require(view->width % 2 == 0 && view->width >= limits.kMinSize && view->width <= limits.max_width);
    fuzz::require(view->height % 2 == 0 && view->height >= limits.kMinSize && view->height <= limits.max_height);
  }
  if (const auto eyes = serve::eye_distance(distance.c_str())) fuzz::require(*eyes >= 0 && *eyes <= 1e6);
  fuzz::require(serve::printable(host).size() <= serve::kLongestLine);
  return 0;
}
