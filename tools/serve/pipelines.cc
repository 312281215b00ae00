// SPDX-License-Identifier: LGPL-2.1-or-later
#include "serve/pipelines.h"

#include <algorithm>
#include <cstring>
#include <sstream>
#include <string>
#include <utility>

#include <gst/rtp/gstrtphdrext.h>
#include <malloc.h>
#include <openssl/crypto.h>
#include <sys/resource.h>

namespace lf::serve {
namespace {

// An H.264 encoder and its options for low latency. Encoders that support constant quality with a maximum bit rate use
// this mode.
struct H264Encoder {
  const char* element;
  const char* options;
  const char* bit_rate;
  int unit;
};

constexpr H264Encoder kH264Encoders[] = {
    {"nvh264enc", "preset=low-latency-hq zerolatency=true gop-size=900 bframes=0 rc-mode=vbr", "bitrate", 1000},
    {"vah264enc", "target-usage=7 key-int-max=900 b-frames=0 rate-control=vbr", "bitrate", 1000},
    {"vaapih264enc", "quality-level=7 keyframe-period=900 max-bframes=0 rate-control=vbr", "bitrate", 1000},
    {"qsvh264enc", "low-latency=true gop-size=900 b-frames=0 rate-control=vbr", "bitrate", 1000},
    // Constant quality up to `bitrate`. More threads would delay pictures or cut them into slices.
    {"x264enc",
     "tune=zerolatency speed-preset=ultrafast threads=1 key-int-max=900 vbv-buf-capacity=300 pass=qual quantizer=23",
     "bitrate", 1000},
    {"openh264enc", "complexity=low rate-control=bitrate gop-size=900 multi-thread=1", "bitrate", 1}};

bool installed(const char* element) {
  g_autoptr(GstElementFactory) factory = gst_element_factory_find(element);
  return factory;
}

// Selects the encoder with the highest rank, which GST_PLUGIN_FEATURE_RANK can change. At equal rank, hardware encoders
// come first.
const H264Encoder* h264_encoder() {
  const H264Encoder* best = nullptr;
  guint best_rank = GST_RANK_NONE;
  for (const H264Encoder& encoder : kH264Encoders) {
    g_autoptr(GstElementFactory) factory = gst_element_factory_find(encoder.element);
    if (!factory) continue;
    const guint rank = gst_plugin_feature_get_rank(GST_PLUGIN_FEATURE(factory));
    if (rank > best_rank) {
      best = &encoder;
      best_rank = rank;
    }
  }
  return best;
}

// The payload of the extension: minimum and maximum delay, 12 bits each, in units of 10 ms. Both are 0.
constexpr gsize kBytes = 3;

struct PlayoutDelay {
  GstRTPHeaderExtension parent;
};
struct PlayoutDelayClass {
  GstRTPHeaderExtensionClass parent_class;
};
G_DEFINE_TYPE(PlayoutDelay, playout_delay, GST_TYPE_RTP_HEADER_EXTENSION)

void playout_delay_init(PlayoutDelay*) {}

void playout_delay_class_init(PlayoutDelayClass* klass) {
  GstRTPHeaderExtensionClass* extension = &klass->parent_class;
  extension->get_supported_flags = [](GstRTPHeaderExtension*) {
    return GstRTPHeaderExtensionFlags(GST_RTP_HEADER_EXTENSION_ONE_BYTE | GST_RTP_HEADER_EXTENSION_TWO_BYTE);
  };
  extension->get_max_size = [](GstRTPHeaderExtension*, const GstBuffer*) { return kBytes; };
  extension->write = [](GstRTPHeaderExtension*, const GstBuffer*, GstRTPHeaderExtensionFlags, GstBuffer*, guint8* data,
                        gsize size) -> gssize {
    if (size < kBytes) return -1;
    std::memset(data, 0, kBytes);
    return kBytes;
  };
  gst_rtp_header_extension_class_set_uri(extension, kPlayoutDelayUri);
  gst_element_class_set_static_metadata(GST_ELEMENT_CLASS(klass), "Playout delay", GST_RTP_HDREXT_ELEMENT_CLASS,
                                        "Has pictures shown as soon as they are decoded", "gst-lightfield");
}

void make_dtls_key() {
  g_autoptr(GstElement) decoder = gst_element_factory_make("dtlsdec", nullptr);
  if (!decoder) throw Error("element dtlsdec is not installed (gstreamer1.0-plugins-bad)");
  g_autofree gchar* pem = nullptr;
  g_object_get(decoder, "pem", &pem, nullptr);
}

void check_elements() {
  const std::pair<const char*, const char*> needed[] = {{"lfviewrequest", "gst-lightfield: see GST_PLUGIN_PATH"},
                                                        {"webrtcbin", "gstreamer1.0-plugins-bad"},
                                                        {"nicesrc", "gstreamer1.0-nice"},
                                                        {"rtph264pay", "gstreamer1.0-plugins-good"},
                                                        {"srtpenc", "gstreamer1.0-plugins-bad"}};
  for (const auto& [element, package] : needed)
    if (!installed(element)) throw Error(std::string("element ") + element + " is not installed (" + package + ")");
  if (!can_encode(VideoCodec::kH264) && !can_encode(VideoCodec::kVp8))
    throw Error("no encoder is installed for H.264 (gstreamer1.0-plugins-ugly) or VP8 (gstreamer1.0-plugins-good)");
}

// A viewer needs about ten open files and a camera two, so the usual limit of 1024 is too low.
void raise_file_limit() {
  rlimit limit{};
  if (getrlimit(RLIMIT_NOFILE, &limit) != 0) return;
  limit.rlim_cur = std::min<rlim_t>(limit.rlim_max, 65536);
  setrlimit(RLIMIT_NOFILE, &limit);
}

}  // namespace

bool can_encode(VideoCodec codec) {
  return codec == VideoCodec::kH264 ? h264_encoder() != nullptr : installed("vp8enc");
}

// Key frames are rare, because browsers request them when needed.
std::string encoder_line(VideoCodec codec, int bits_per_second, const std::string& name) {
  std::ostringstream line;
  if (codec == VideoCodec::kVp8) {
    line << "vp8enc name=" << name
         << " deadline=1 cpu-used=16 threads=1 lag-in-frames=0 end-usage=cq cq-level=20 "
            "keyframe-max-dist=900 error-resilient=default buffer-initial-size=200 buffer-optimal-size=300 "
            "buffer-size=500 target-bitrate="
         << bits_per_second;
  } else {
    const H264Encoder& encoder = *h264_encoder();
    line << encoder.element << " name=" << name << ' ' << encoder.options << ' ' << encoder.bit_rate << '='
         << bits_per_second / encoder.unit << " ! video/x-h264,profile=constrained-baseline";
  }
  return line.str();
}

std::string payloader_line(const Offer& offer) {
  std::ostringstream line;
  line << (offer.codec == VideoCodec::kVp8 ? "rtpvp8pay picture-id-mode=15-bit"
                                           : "rtph264pay config-interval=-1 aggregate-mode=zero-latency")
       << " name=payloader mtu=1200 timestamp-offset=0 pt=" << offer.payload_type
       << " ! capsfilter caps=application/x-rtp,media=video,encoding-name=" << to_string(offer.codec)
       << ",payload=" << offer.payload_type;
  return line.str();
}

void set_bit_rate(GstElement* element, int bits_per_second) {
  const char* name = GST_OBJECT_NAME(gst_element_get_factory(element));
  for (const H264Encoder& encoder : kH264Encoders)
    if (g_str_equal(name, encoder.element))
      return g_object_set(element, encoder.bit_rate, bits_per_second / encoder.unit, nullptr);
  g_object_set(element, "target-bitrate", bits_per_second, nullptr);
}

void add_playout_delay(GstElement* payloader, guint id) {
  GstRTPHeaderExtension* extension = GST_RTP_HEADER_EXTENSION(g_object_new(playout_delay_get_type(), nullptr));
  gst_rtp_header_extension_set_id(extension, id);
  g_signal_emit_by_name(payloader, "add-extension", extension);
}

void prepare_process() {
  // Viewers start and end many threads, and one malloc arena per thread would fragment memory.
  mallopt(M_ARENA_MAX, 2);
  raise_file_limit();
  // Prevents OpenSSL's cleanup at exit. GStreamer threads may still use DTLS after it, and the state that they then
  // create per thread would leak.
  OPENSSL_init_crypto(OPENSSL_INIT_NO_ATEXIT, nullptr);
}

void prepare_elements() {
  check_elements();
  make_dtls_key();
}

}  // namespace lf::serve
