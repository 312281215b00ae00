// SPDX-License-Identifier: LGPL-2.1-or-later
// Offers of browsers: what is taken can be written, and names what webrtcbin relies on. The work is proportional to the
// length.
#include <gst/gst.h>

#include <ctime>
#include <string>

#include "fuzz/fuzz.h"
#include "fuzz/gst_start.h"
#include "serve/offer.h"

// Processor time, which other programs do not lengthen.
static double seconds_of_thread() {
  timespec now{};
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
  return static_cast<double>(now.tv_sec) + 1e-9 * static_cast<double>(now.tv_nsec);
}

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
  // Much more than it takes under a sanitizer, and much less than work that grows with the square of the length. A
  // virtual machine that stands still for a moment may lengthen one measurement.
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
  serve::name_profile(again, *offer);
  gst_sdp_message_free(again);
  return 0;
}
