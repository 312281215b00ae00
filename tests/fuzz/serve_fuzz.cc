// SPDX-License-Identifier: LGPL-2.1-or-later
#include <algorithm>
#include <array>
#include <cmath>
#include <ctime>
#include <string>

#include <gst/gst.h>

#include "base/text.h"
#include "fuzz/fuzz.h"
#include "fuzz/gst_start.h"
#include "serve/access.h"
#include "serve/control_message.h"
#include "serve/limits.h"
#include "serve/offer.h"
#include "serve/process.h"

namespace {

using namespace lf;

bool is_plain(const std::string& text) {
  return std::ranges::all_of(text, [](char c) { return c > ' ' && c <= '~' && c != '"' && c != ','; });
}

// Options in canonical form stay unchanged and match themselves.
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

// Request headers and query, one per line: Host, Origin, Sec-Fetch-Site, Authorization, X-Forwarded-For,
// X-Forwarded-Prefix, and the query's width, height and eye-distance.
LF_FUZZ_TARGET(http)(const uint8_t* data, size_t size) {
  static const serve::Access access("sesame", {"https://example.org"}, {"cameras.example"});
  std::array<std::string, 9> lines;
  for (size_t i = 0, line = 0; i < size && line < lines.size(); i++) {
    if (data[i] == '\n')
      line++;
    else if (data[i] != 0)  // headers contain no NUL
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

// CPU time, which other programs do not affect.
static double seconds_of_thread() {
  timespec now{};
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
  return static_cast<double>(now.tv_sec) + 1e-9 * static_cast<double>(now.tv_nsec);
}

// Offers of browsers: accepted offers can be serialised and contain everything webrtcbin relies on. The work is
// proportional to the length.
LF_FUZZ_TARGET(offer)(const uint8_t* data, size_t size) {
  using namespace lf;
  std::string reason;
  const auto parse = [&] {
    return serve::parse_offer(std::string(reinterpret_cast<const char*>(data), size), true, true, {"127.0.0.1"},
                              &reason);
  };
  const auto cost_of_parsing = [&] {
    const double began = seconds_of_thread();
    parse();
    return seconds_of_thread() - began;
  };
  // Far above the cost under a sanitizer, and far below quadratic cost. A virtual machine that pauses may lengthen one
  // measurement.
  const double most = 0.05 + 10e-6 * static_cast<double>(size);
  fuzz::require(cost_of_parsing() < most || cost_of_parsing() < most || cost_of_parsing() < most);
  const auto offer = parse();
  fuzz::require(offer || !reason.empty());
  if (!offer) return 0;
  fuzz::require(offer->payload_type <= 127);
  fuzz::require(offer->codec != serve::VideoCodec::kH264 || offer->profile.size() == 6);
  g_autofree gchar* text = gst_sdp_message_as_text(offer->sdp.get());
  GstSDPMessage* again = nullptr;
  fuzz::require(gst_sdp_message_new_from_text(text, &again) == GST_SDP_OK);
  serve::set_profile(again, *offer);
  gst_sdp_message_free(again);
  return 0;
}

// Messages of the data channel: parsing gives an event or a reason, never both, and only finite numbers.
LF_FUZZ_TARGET(control)(const uint8_t* data, size_t size) {
  using namespace lf;
  const auto message = serve::parse_control_message({reinterpret_cast<const char*>(data), size}, 0.5);
  fuzz::require(!message.event || message.error.empty());
  fuzz::require(!message.event || message.id);
  if (!message.event) return 0;
  fuzz::require(gst_event_type_get_flags(GST_EVENT_TYPE(message.event.get())) & GST_EVENT_TYPE_UPSTREAM);
  const GstStructure* structure = gst_event_get_structure(message.event.get());
  for (int i = 0; i < gst_structure_n_fields(structure); i++) {
    const GValue* value = gst_structure_get_value(structure, gst_structure_nth_field_name(structure, i));
    fuzz::require(!G_VALUE_HOLDS_DOUBLE(value) || std::isfinite(g_value_get_double(value)));
  }
  serve::control_response(*message.id, message.error);
  return 0;
}
