// SPDX-License-Identifier: LGPL-2.1-or-later
#include "environment.h"

#include <gst/gst.h>
#include <malloc.h>
#include <openssl/crypto.h>
#include <sys/resource.h>

#include <algorithm>
#include <string>
#include <utility>

#include "base/error.h"
#include "encoder.h"

namespace lf::serve {
namespace {

void make_dtls_key() {
  GstElement* decoder = gst_element_factory_make("dtlsdec", nullptr);
  if (!decoder) throw lf::Error("element dtlsdec is not installed (gstreamer1.0-plugins-bad)");
  g_autofree gchar* pem = nullptr;
  g_object_get(decoder, "pem", &pem, nullptr);
  gst_object_unref(decoder);
}

void check_elements() {
  const std::pair<const char*, const char*> needed[] = {{"lfviewrequest", "gst-lightfield: see GST_PLUGIN_PATH"},
                                                        {"webrtcbin", "gstreamer1.0-plugins-bad"},
                                                        {"nicesrc", "gstreamer1.0-nice"},
                                                        {"rtph264pay", "gstreamer1.0-plugins-good"},
                                                        {"srtpenc", "gstreamer1.0-plugins-bad"}};
  for (const auto& [element, package] : needed) {
    GstElementFactory* factory = gst_element_factory_find(element);
    if (!factory) throw lf::Error(std::string("element ") + element + " is not installed (" + package + ")");
    gst_object_unref(factory);
  }
  if (!can_encode(VideoCodec::kH264) && !can_encode(VideoCodec::kVp8))
    throw lf::Error("no encoder is installed for H.264 (gstreamer1.0-plugins-ugly) or VP8 (gstreamer1.0-plugins-good)");
}

// A viewer takes about ten files, a camera two: the usual 1024 are soon used up.
void raise_file_limit() {
  rlimit limit{};
  if (getrlimit(RLIMIT_NOFILE, &limit) != 0) return;
  limit.rlim_cur = std::min<rlim_t>(limit.rlim_max, 65536);
  setrlimit(RLIMIT_NOFILE, &limit);
}

}  // namespace

void prepare_process() {
  // Viewers come and go with all their threads: with an arena each, memory would be torn to pieces.
  mallopt(M_ARENA_MAX, 2);
  raise_file_limit();
  // GStreamer's threads may still be at work on DTLS while the process ends: they would use what OpenSSL has cleaned up
  // by then, and what each of them has of it, as random generators, would never be freed.
  OPENSSL_init_crypto(OPENSSL_INIT_NO_ATEXIT, nullptr);
}

void prepare_elements() {
  check_elements();
  make_dtls_key();
}

}  // namespace lf::serve
