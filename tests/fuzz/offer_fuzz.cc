// SPDX-License-Identifier: LGPL-2.1-or-later
// Offers of browsers: what is taken can be written, and names what webrtcbin relies on.
#include <gst/gst.h>
#include <sanitizer/lsan_interface.h>

#include <string>

#include "fuzz/fuzz.h"
#include "serve/offer.h"

extern "C" int LLVMFuzzerInitialize(int*, char***) {
  __lsan_disable();  // GLib and GStreamer never free what they begin with
  gst_init(nullptr, nullptr);
  __lsan_enable();
  g_log_set_always_fatal(GLogLevelFlags(G_LOG_LEVEL_CRITICAL | G_LOG_FATAL_MASK));
  return 0;
}

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  using namespace lf;
  std::string reason;
  const auto offer = serve::parse_offer(std::string(reinterpret_cast<const char*>(data), size), true, true, &reason);
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
