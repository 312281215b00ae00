// SPDX-License-Identifier: LGPL-2.1-or-later
#include "encoder.h"

#include <sstream>

namespace lf::serve {
namespace {

bool installed(const char* element) {
  GstElementFactory* factory = gst_element_factory_find(element);
  if (factory) gst_object_unref(factory);
  return factory;
}

const char* h264_encoder() {
  for (const char* element : {"x264enc", "openh264enc"})
    if (installed(element)) return element;
  return nullptr;
}

}  // namespace

bool can_encode(VideoCodec codec) {
  return codec == VideoCodec::kH264 ? h264_encoder() != nullptr : installed("vp8enc");
}

// Browsers ask for a key frame when they need one.
std::string encoder_line(const Offer& offer, int bits_per_second) {
  std::ostringstream line;
  if (offer.codec == VideoCodec::kVp8) {
    line << "vp8enc name=encoder deadline=1 cpu-used=16 threads=1 lag-in-frames=0 end-usage=cbr keyframe-max-dist=900 "
            "error-resilient=default buffer-initial-size=200 buffer-optimal-size=300 buffer-size=500 target-bitrate="
         << bits_per_second << " ! rtpvp8pay name=payloader picture-id-mode=15-bit";
  } else if (g_str_equal(h264_encoder(), "x264enc")) {
    line << "x264enc name=encoder tune=zerolatency speed-preset=ultrafast trellis=false threads=1 key-int-max=900 "
            "vbv-buf-capacity=300 "
            "bitrate="
         << bits_per_second / 1000 << " ! video/x-h264,profile=constrained-baseline ! rtph264pay name=payloader";
  } else {
    line << "openh264enc name=encoder complexity=low rate-control=bitrate gop-size=900 bitrate=" << bits_per_second
         << " ! video/x-h264,profile=constrained-baseline ! rtph264pay name=payloader";
  }
  if (offer.codec == VideoCodec::kH264) line << " config-interval=-1 aggregate-mode=zero-latency";
  line << " mtu=1200 timestamp-offset=0 pt=" << offer.payload_type
       << " ! capsfilter caps=application/x-rtp,media=video,encoding-name=" << to_string(offer.codec)
       << ",payload=" << offer.payload_type;
  return line.str();
}

void set_bit_rate(GstElement* encoder, int bits_per_second) {
  const std::string type = GST_OBJECT_NAME(gst_element_get_factory(encoder));
  if (type == "x264enc")
    g_object_set(encoder, "bitrate", static_cast<guint>(bits_per_second / 1000), nullptr);
  else if (type == "openh264enc")
    g_object_set(encoder, "bitrate", static_cast<guint>(bits_per_second), nullptr);
  else
    g_object_set(encoder, "target-bitrate", bits_per_second, nullptr);
}

}  // namespace lf::serve
