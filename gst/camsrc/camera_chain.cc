// SPDX-License-Identifier: LGPL-2.1-or-later
#include "camsrc/camera_chain.h"

#include <gst/video/video.h>

#include <atomic>
#include <cstring>

#include "camsrc/camera_controls.h"
#include "camsrc/chain_links.h"
#include "camsrc/described_source.h"
#include "camsrc/lfpicturesrc.h"
#include "camsrc/lfscenesrc.h"
#include "common/common.h"

namespace lf {
namespace {

using Kind = CameraSource::Kind;

// Files are read in few large pieces: a still is one.
constexpr guint kBlockSize = 1 << 20;

GstElement* add_capsfilter(GstBin* bin, GstCaps* caps) {
  GstElement* filter = add(bin, "capsfilter");
  g_object_set(filter, "caps", caps, nullptr);
  gst_caps_unref(caps);
  return filter;
}

GstCaps* frame_rate_caps(int fps_n, int fps_d) {
  GstCaps* caps = gst_caps_from_string("video/x-raw; image/jpeg");
  gst_caps_set_simple(caps, "framerate", GST_TYPE_FRACTION, fps_n, fps_d, nullptr);
  return caps;
}

GstCaps* camera_caps(const Camera& camera) {
  GstCaps* caps = gst_caps_from_string("video/x-raw, format = (string) { " LF_RGB_FORMATS ", I420 }");
  gst_caps_set_simple(caps, "width", G_TYPE_INT, camera.width, "height", G_TYPE_INT, camera.height, nullptr);
  return caps;
}

GstElement* add_file_reader(GstBin* bin, const std::string& path) {
  GstElement* reader = add(bin, "filesrc");
  g_object_set(reader, "location", path.c_str(), "blocksize", kBlockSize, nullptr);
  return reader;
}

// A decoder whose pads appear later; they are linked with `convert` then.
GstElement* add_decodebin(GstBin* bin, const char* factory, GstElement* convert) {
  GstElement* decoder = add(bin, factory);
  // ANY: decoders that can also give interlaced pictures or a GPU's memory are passed over otherwise.
  GstCaps* caps = gst_caps_from_string(may_bypass(convert) ? "image/jpeg; video/x-raw(ANY)" : "video/x-raw(ANY)");
  g_object_set(decoder, "caps", caps, "expose-all-streams", FALSE, nullptr);
  gst_caps_unref(caps);
  g_signal_connect(decoder, "pad-added", G_CALLBACK(lf::callback<on_decoded_pad>), convert);
  g_signal_connect(decoder, "no-more-pads", G_CALLBACK(lf::callback<on_no_more_pads>), nullptr);
  return decoder;
}

// Counts the bytes that a network camera has sent since its latest picture. Demuxers buffer an incomplete picture
// without limit.
class UnusedBytes {
 public:
  static constexpr size_t kMost = size_t{64} << 20;
  void add(size_t bytes) { bytes_ += bytes; }
  void clear() { bytes_ = 0; }
  bool are_too_many() const { return bytes_ > kMost; }
  // Returns true the first time.
  bool tell() { return !told_.exchange(true); }

 private:
  std::atomic<size_t> bytes_ = 0;
  std::atomic<bool> told_ = false;
};
using UnusedBytesPtr = std::shared_ptr<UnusedBytes>;

GstPadProbeReturn count_bytes(GstPad* pad, GstPadProbeInfo* info, gpointer data) {
  UnusedBytes& unused = **static_cast<UnusedBytesPtr*>(data);
  unused.add(gst_buffer_get_size(GST_PAD_PROBE_INFO_BUFFER(info)));
  if (!unused.are_too_many()) return GST_PAD_PROBE_OK;
  GstElement* source = gst_pad_get_parent_element(pad);
  if (source && unused.tell())
    GST_ELEMENT_ERROR(source, STREAM, DEMUX, ("it sends more than %zu MB without a picture", UnusedBytes::kMost >> 20),
                      (nullptr));
  if (source) gst_object_unref(source);
  return GST_PAD_PROBE_DROP;
}

GstPadProbeReturn on_picture(GstPad* /*pad*/, GstPadProbeInfo* /*info*/, gpointer data) {
  (*static_cast<UnusedBytesPtr*>(data))->clear();
  return GST_PAD_PROBE_OK;
}

void add_probe(GstPad* pad, GstPadProbeCallback callback, const UnusedBytesPtr& unused) {
  gst_pad_add_probe(pad, GST_PAD_PROBE_TYPE_BUFFER, callback, new UnusedBytesPtr(unused),
                    [](gpointer data) { delete static_cast<UnusedBytesPtr*>(data); });
}

struct SourceSetup {
  GstClockTime latency;
  std::shared_ptr<SenderClock> sender;
  UnusedBytesPtr unused;
};

void on_source_setup(GstElement* /*decoder*/, GstElement* source, gpointer data) {
  const auto* setup = static_cast<SourceSetup*>(data);
  if (g_object_class_find_property(G_OBJECT_GET_CLASS(source), "latency"))
    g_object_set(source, "latency", static_cast<guint>(setup->latency / GST_MSECOND), nullptr);  // milliseconds
  if (setup->sender) setup->sender->watch(source);
  g_autoptr(GstPad) pad = gst_element_get_static_pad(source, "src");
  if (setup->unused && pad) add_probe(pad, count_bytes, setup->unused);
}

// uridecodebin never disconnects from its decodebin, which messages on the bus may keep alive for longer (GStreamer
// 1.22): a pad that is still there when that ends would be removed from an element that is gone.
void forget_decodebin(gpointer data, GObject* uridecodebin) {
  auto* decodebin = static_cast<GWeakRef*>(data);
  if (GObject* alive = static_cast<GObject*>(g_weak_ref_get(decodebin))) {
    g_signal_handlers_disconnect_by_data(alive, uridecodebin);
    g_object_unref(alive);
  }
  g_weak_ref_clear(decodebin);
  delete decodebin;
}

void on_child_of_uridecodebin(GstBin* uridecodebin, GstElement* child, gpointer /*unused*/) {
  GstElementFactory* factory = gst_element_get_factory(child);
  if (!factory || std::strcmp(GST_OBJECT_NAME(factory), "decodebin") != 0) return;
  auto* decodebin = new GWeakRef;
  g_weak_ref_init(decodebin, child);
  g_object_weak_ref(G_OBJECT(uridecodebin), forget_decodebin, decodebin);
}

// A playlist (HLS) from the network must not open files of this machine.
void refuse_file(GstBin* uridecodebin, GstBin* /*parent*/, GstElement* child, gpointer /*unused*/) {
  GstElementFactory* factory = gst_element_get_factory(child);
  if (!factory || std::strcmp(GST_OBJECT_NAME(factory), "filesrc") != 0) return;
  g_autoptr(GstPad) pad = gst_element_get_static_pad(child, "src");
  const auto drop = [](GstPad*, GstPadProbeInfo*, gpointer) { return GST_PAD_PROBE_DROP; };
  gst_pad_add_probe(pad, GST_PAD_PROBE_TYPE_BUFFER, drop, nullptr, nullptr);
  GST_ELEMENT_ERROR(uridecodebin, RESOURCE, NOT_AUTHORIZED, ("its playlist names a file of this machine"),
                    (nullptr));
}

// What tells the times of the sender, if it may.
std::shared_ptr<SenderClock> add_uri_decoder(GstBin* bin, const std::string& uri, const ChainOptions& options,
                                             GstElement* convert) {
  GstElement* decoder = add_decodebin(bin, "uridecodebin", convert);
  g_signal_connect(decoder, "element-added", G_CALLBACK(lf::callback<on_child_of_uridecodebin>), nullptr);
  g_object_set(decoder, "uri", uri.c_str(), nullptr);
  std::shared_ptr<SenderClock> sender;
  if (g_str_has_prefix(uri.c_str(), "rtsp")) sender = std::make_shared<SenderClock>(options.latency);
  UnusedBytesPtr unused;
  if (!g_str_has_prefix(uri.c_str(), "file:")) {
    g_signal_connect(decoder, "deep-element-added", G_CALLBACK(lf::callback<refuse_file>), nullptr);
    unused = std::make_shared<UnusedBytes>();
    add_probe(borrow_pad(convert, "sink"), on_picture, unused);
  }
  g_signal_connect_data(
      decoder, "source-setup", G_CALLBACK(callback<on_source_setup>), new SourceSetup{options.latency, sender, unused},
      [](gpointer setup, GClosure*) { delete static_cast<SourceSetup*>(setup); }, GConnectFlags(0));
  return sender;
}

// What a device is asked for: left to itself it takes the largest pictures it has. JPEG first where it stays JPEG.
GstCaps* device_caps(const Camera& camera, const ChainOptions& options) {
  GstCaps* caps = gst_caps_from_string(options.decode ? "video/x-raw; image/jpeg; video/x-h264"
                                                      : "image/jpeg; video/x-raw; video/x-h264");
  gst_caps_set_simple(caps, "width", G_TYPE_INT, camera.width, "height", G_TYPE_INT, camera.height, nullptr);
  if (options.fps_n > 0)
    gst_caps_set_simple(caps, "framerate", GST_TYPE_FRACTION, options.fps_n, options.fps_d, nullptr);
  return caps;
}

GstElement* add_device(GstBin* bin, const std::string& uri, const Camera& camera, const ChainOptions& options,
                       GstElement* convert) {
  g_autoptr(GError) error = nullptr;
  GstElement* device = gst_element_make_from_uri(GST_URI_SRC, uri.c_str(), nullptr, &error);
  if (!device) throw Error(error->message);
  gst_bin_add(bin, device);
  append(append(device, add_capsfilter(bin, device_caps(camera, options))), add_decodebin(bin, "decodebin", convert));
  return device;
}

// What elements are asked for: raw video, on a graphics card, too, and JPEG of the rig's size. Parsers and depayloaders
// may not know the size of what is coded until it is decoded.
GstCaps* bin_caps(const Camera& camera, const ChainOptions& options) {
  GstCaps* caps = device_caps(camera, options);
  GstStructure* raw = gst_structure_copy(gst_caps_get_structure(caps, options.decode ? 0 : 1));
  gst_structure_set(raw, "texture-target", G_TYPE_STRING, "2D", nullptr);
  gst_caps_append_structure_full(caps, raw, gst_caps_features_new(LF_GL_MEMORY, nullptr));
  gst_caps_append(caps, gst_caps_from_string("image/jpeg; video/x-h264; video/x-h265; video/mpeg; video/x-vp8"));
  return caps;
}

GstElement* add_described(GstBin* bin, const std::string& line, const Camera& camera, const ChainOptions& options,
                          GstElement* convert) {
  GstElement* described = make_described_source(line, options.trusted);
  gst_bin_add(bin, described);
  append(append(described, add_capsfilter(bin, bin_caps(camera, options))), add_decodebin(bin, "decodebin", convert));
  return described;
}

void add_matroska_reader(GstBin* bin, const std::string& path, GstElement* convert) {
  GstElement* reader = add_file_reader(bin, path);
  GstElement* demuxer = append(reader, add(bin, "matroskademux"));
  g_signal_connect(demuxer, "pad-added", G_CALLBACK(lf::callback<on_matroska_pad>), convert);
  g_signal_connect(demuxer, "no-more-pads", G_CALLBACK(lf::callback<on_no_more_pads>), nullptr);
}

// What GStreamer's own URI of the file is.
std::string file_uri(const std::string& path) {
  g_autoptr(GError) error = nullptr;
  g_autofree gchar* uri = gst_filename_to_uri(path.c_str(), &error);
  if (!uri) throw Error(path + ": " + error->message);
  return uri;
}

void add_pictures(GstBin* bin, const CameraSource& source, const Camera& camera, const ChainOptions& options, int fps_n,
                  int fps_d, GstElement* convert, const std::shared_ptr<std::atomic<guint64>>& damaged) {
  const bool passes = may_bypass(convert) && source.codec == CameraSource::Codec::kJpeg;
  if (passes) bypass(convert);
  GstElement* pictures = new_picture_source(source, {.width = camera.width,
                                                     .height = camera.height,
                                                     .fps_n = fps_n,
                                                     .fps_d = fps_d,
                                                     .loop = options.loop,
                                                     .decode = !passes,
                                                     .damaged = damaged});
  gst_bin_add(bin, pictures);
  append(pictures, convert);
}

GstElement* add_scene(GstBin* bin, const Camera& camera, int fps_n, int fps_d, bool live) {
  GstElement* scene = new_scene_source(camera, fps_n, fps_d, live);
  gst_bin_add(bin, scene);
  return scene;
}

// Puts in what feeds `convert`.
void add_reader(GstBin* bin, const CameraSource& source, const Camera& camera, const ChainOptions& options, int fps_n,
                int fps_d, GstElement* convert, CameraChain* chain) {
  switch (source.kind) {
    case Kind::kStill:
      if (source.codec == CameraSource::Codec::kOther) {
        add_uri_decoder(bin, file_uri(source.location), options, convert);
        break;
      }
      [[fallthrough]];
    case Kind::kSequence:
    case Kind::kJpegStream: add_pictures(bin, source, camera, options, fps_n, fps_d, convert, chain->damaged); break;
    case Kind::kMatroska: add_matroska_reader(bin, source.location, convert); break;
    case Kind::kFile: add_uri_decoder(bin, file_uri(source.location), options, convert); break;
    case Kind::kDevice: chain->device = add_device(bin, source.location, camera, options, convert); break;
    case Kind::kBin: chain->device = add_described(bin, source.location, camera, options, convert); break;
    case Kind::kUri: chain->sender = add_uri_decoder(bin, source.location, options, convert); break;
    case Kind::kScene: append(add_scene(bin, camera, fps_n, fps_d, options.live), convert); break;
  }
}

}  // namespace

CameraChain build_camera_chain(GstBin* bin, const CameraSource& source, const Camera& camera,
                               const ChainOptions& options) {
  const bool own_rate = options.fps_n == 0;
  const int fps_n = own_rate ? kDefaultFps : options.fps_n;
  const int fps_d = own_rate ? 1 : options.fps_d;
  GstElement* convert = add(bin, "videoconvert");
  CameraChain chain;
  const auto append_to_tail = [&](GstElement* next) { chain.tail.push_back(append(chain.tail.back(), next)); };
  if (options.decode || source.kind == Kind::kStill || source.kind == Kind::kScene) {
    chain.tail = {convert};
    append_to_tail(add_capsfilter(bin, camera_caps(camera)));
    if (source.kind == Kind::kStill) append_to_tail(add(bin, "imagefreeze"));
  } else {
    chain.tail = {add(bin, "identity", kBeforeConvert)};
    append_to_tail(convert);
    append_to_tail(add_capsfilter(bin, camera_caps(camera)));
    append_to_tail(add(bin, "identity", kAfterConvert));
  }
  chain.decoded = borrow_pad(chain.tail.front(), "sink");
  chain.frames = borrow_pad(chain.tail.back(), "src");
  add_reader(bin, source, camera, options, fps_n, fps_d, chain.tail.front(), &chain);
  if (chain.device) apply_controls(chain.device, options.controls);
  const bool has_rate = source.kind == Kind::kMatroska || source.kind == Kind::kFile || source.kind == Kind::kUri;
  if (has_rate && !own_rate) append_to_tail(add(bin, "videorate"));
  if (source.kind == Kind::kStill || (has_rate && !own_rate))
    append_to_tail(add_capsfilter(bin, frame_rate_caps(fps_n, fps_d)));
  if (options.live && source.kind != Kind::kDevice) append_to_tail(add(bin, "clocksync"));
  chain.out = borrow_pad(chain.tail.back(), "src");
  return chain;
}

}  // namespace lf
