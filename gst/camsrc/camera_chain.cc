// SPDX-License-Identifier: LGPL-2.1-or-later
#include "camsrc/camera_chain.h"

#include <atomic>
#include <cstring>
#include <vector>

#include <gst/gst.h>
#include <gst/video/video.h>

#include "base/text.h"
#include "camsrc/camera_controls.h"
#include "camsrc/picture_sources.h"
#include "common/codecs.h"
#include "common/common.h"
#include "common/gst_pointers.h"
#include "common/guard.h"
#include "rig/source_security.h"

namespace lf {
namespace {

constexpr int kData = GST_PAD_PROBE_TYPE_BUFFER | GST_PAD_PROBE_TYPE_BUFFER_LIST;
constexpr const char* kAddMeta = "add-reference-timestamp-meta";
constexpr GstClockTime k1970 = 2'208'988'800 * GST_SECOND;  // NTP time of the Unix epoch

GstClockTime time_of_day() { return static_cast<GstClockTime>(g_get_real_time()) * GST_USECOND; }

bool is_video(GstPad* pad) {
  g_autoptr(GstCaps) caps = gst_pad_get_current_caps(pad);
  if (!caps) caps = gst_pad_query_caps(pad, nullptr);
  const GstStructure* structure = gst_caps_get_size(caps) > 0 ? gst_caps_get_structure(caps, 0) : nullptr;
  const gchar* media = structure ? gst_structure_get_string(structure, "media") : nullptr;
  return !media || g_str_equal(media, "video");
}

// Returns the capture time of a packet as time of day, from RTCP sender reports. Returns nothing before the first
// report.
std::optional<GstClockTime> ntp_time(GstBuffer* packet) {
  static GstStaticCaps ntp = GST_STATIC_CAPS("timestamp/x-ntp");
  g_autoptr(GstCaps) reference = gst_static_caps_get(&ntp);
  const GstReferenceTimestampMeta* meta = gst_buffer_get_reference_timestamp_meta(packet, reference);
  if (!meta || meta->timestamp < k1970) return std::nullopt;
  return meta->timestamp;
}

GstClockTime running_time(GstPad* pad, GstClockTime pts) {
  g_autoptr(GstEvent) event = gst_pad_get_sticky_event(pad, GST_EVENT_SEGMENT, 0);
  if (!event) return GST_CLOCK_TIME_NONE;
  const GstSegment* segment = nullptr;
  gst_event_parse_segment(event, &segment);
  return gst_segment_to_running_time(segment, GST_FORMAT_TIME, pts);
}

}  // namespace

void SenderClock::see(GstClockTime stamp, GstClockTime sent, GstClockTime now) {
  const GstClockTimeDiff age = GST_CLOCK_DIFF(sent, now);
  const bool true_enough =
      age >= -static_cast<GstClockTimeDiff>(kMaxAhead) && age <= static_cast<GstClockTimeDiff>(latency_ + kMaxAge);
  const std::lock_guard lock(mutex_);
  offset_.reset();
  if (true_enough) offset_ = GST_CLOCK_DIFF(stamp, sent);
}

std::optional<GstClockTime> SenderClock::taken(GstClockTime stamp) const {
  const std::lock_guard lock(mutex_);
  if (!offset_) return std::nullopt;
  return stamp + static_cast<GstClockTime>(*offset_);
}

bool SenderClock::is_known() const {
  const std::lock_guard lock(mutex_);
  return offset_.has_value();
}

GstPadProbeReturn SenderClock::on_packet(GstPad* pad, GstPadProbeInfo* info) {
  GstBuffer* packet = nullptr;
  if (!(info->type & GST_PAD_PROBE_TYPE_BUFFER_LIST))
    packet = GST_PAD_PROBE_INFO_BUFFER(info);
  else if (GstBufferList* list = GST_PAD_PROBE_INFO_BUFFER_LIST(info); gst_buffer_list_length(list) > 0)
    packet = gst_buffer_list_get(list, 0);
  const std::optional<GstClockTime> ntp = packet ? ntp_time(packet) : std::nullopt;
  if (!ntp) return GST_PAD_PROBE_OK;
  const GstClockTime stamp = running_time(pad, GST_BUFFER_PTS(packet));
  if (GST_CLOCK_TIME_IS_VALID(stamp)) see(stamp, *ntp - k1970, time_of_day());
  return GST_PAD_PROBE_OK;
}

void SenderClock::on_pad(GstElement*, GstPad* pad, gpointer data) {
  if (!GST_PAD_IS_SRC(pad) || !is_video(pad)) return;
  add_probe(pad, kData, [clock = *static_cast<std::shared_ptr<SenderClock>*>(data)](GstPad* at, GstPadProbeInfo* info) {
    return clock->on_packet(at, info);
  });
}

void SenderClock::watch(GstElement* source) {
  if (!g_object_class_find_property(G_OBJECT_GET_CLASS(source), kAddMeta)) return;
  g_object_set(source, kAddMeta, TRUE, nullptr);
  g_signal_connect_data(
      source, "pad-added", G_CALLBACK(callback<on_pad>), new std::shared_ptr(shared_from_this()),
      [](gpointer self, GClosure*) { delete static_cast<std::shared_ptr<SenderClock>*>(self); }, GConnectFlags(0));
}

namespace {

using Kind = CameraSource::Kind;

// Returns true if the source element of the URI has a pad with pictures, rather than with bytes or packets.
bool has_picture_pad(const std::string& uri) {
  g_autoptr(GstElement) source = gst_element_make_from_uri(GST_URI_SRC, uri.c_str(), nullptr, nullptr);
  if (!source) return false;
  gst_object_ref_sink(source);
  g_autoptr(GstPad) pad = gst_element_get_static_pad(source, "src");
  g_autoptr(GstCaps) caps = pad ? gst_pad_get_pad_template_caps(pad) : nullptr;
  for (guint i = 0; caps && i < gst_caps_get_size(caps) && !gst_caps_is_any(caps); i++) {
    const gchar* name = gst_structure_get_name(gst_caps_get_structure(caps, i));
    if (g_str_equal(name, "video/x-raw") || g_str_equal(name, "image/jpeg")) return true;
  }
  return false;
}

constexpr char kEnd[] = "end-of-described-source";

// Throws Error if a bin contains an element that is not allowed in an untrusted rig. The text of the launch description
// has already been checked, but with a partial parser (rig/source_security.h). This function checks the elements that
// GStreamer has actually created.
void require_listed_elements(GstBin* source) {
  for (const GList* item = source->children; item; item = item->next) {
    GstElementFactory* factory = gst_element_get_factory(GST_ELEMENT(item->data));
    const std::string name = factory ? GST_OBJECT_NAME(factory) : "a bin";
    if (!is_trusted_element(name)) throw Error("its source has " + name + ", which needs trusted=true");
  }
}

// Parses a launch description into a bin with one source pad, "src". The caller owns the reference. Throws Error if the
// description is invalid, or if it is not `trusted` and contains an element that is not listed in
// rig/source_security.h. An identity is appended, because a description may end with caps or with an element with
// sometimes pads.
GstElement* make_described_source(const std::string& line, bool trusted) {
  g_autoptr(GError) error = nullptr;
  const std::string whole = line + " ! identity name=" + kEnd;
  g_autoptr(GstElement) source =
      gst_parse_bin_from_description_full(whole.c_str(), FALSE, nullptr, GST_PARSE_FLAG_FATAL_ERRORS, &error);
  if (source) gst_object_ref_sink(source);
  if (!source || error || !GST_OBJECT_FLAG_IS_SET(source, GST_ELEMENT_FLAG_SOURCE))
    throw Error(error ? error->message
                      : "the description has no source element: begin it with a source, such as "
                        "v4l2src device=/dev/video0");
  if (!trusted) require_listed_elements(GST_BIN(source));
  g_autoptr(GstElement) end = gst_bin_get_by_name(GST_BIN(source), kEnd);
  g_autoptr(GstPad) pad = gst_element_get_static_pad(end, "src");
  gst_element_add_pad(source, gst_ghost_pad_new("src", pad));
  return g_steal_pointer(&source);
}

// --- Links between elements, which may have dynamic pads -------------------------------------------------------------

GstElement* add(GstBin* bin, const char* factory, const char* name = nullptr) {
  GstElement* element = gst_element_factory_make(factory, name);
  if (!element) throw MissingElement(factory);
  gst_bin_add(bin, element);
  return element;
}

// The returned pad is borrowed and lives as long as its element.
GstPad* borrow_pad(GstElement* element, const char* name) {
  GstPad* pad = gst_element_get_static_pad(element, name);
  gst_object_unref(pad);
  return pad;
}

// Appends `next` to the chain that ends in `tail`. These elements always fit, so the link is unchecked.
GstElement* append(GstElement* tail, GstElement* next) {
  if (tail) gst_element_link_pads_full(tail, "src", next, "sink", GST_PAD_LINK_CHECK_NOTHING);
  return next;
}

GstElement* add_jpeg_decoder(GstBin* bin) {
  GstElement* decoder = add(bin, "jpegdec");
  gst_util_set_object_arg(G_OBJECT(decoder), "idct-method", "islow");  // the default loses PSNR and is not faster
  g_object_set(decoder, "qos", FALSE, nullptr);                        // do not skip late frames
  return decoder;
}

// Names of the identities in front of and behind the converter. JPEG and GPU pictures bypass the converter, and
// handlers of new pads find the two elements by name.
constexpr const char* kBeforeConvert = "before-convert";
constexpr const char* kAfterConvert = "after-convert";

bool may_bypass(GstElement* head) { return g_strcmp0(GST_OBJECT_NAME(head), kBeforeConvert) == 0; }

// Links the first identity directly to the last. Call before data flows.
void bypass(GstElement* before) {
  g_autoptr(GstObject) bin = gst_element_get_parent(before);
  if (!bin) return;
  g_autoptr(GstElement) after = gst_bin_get_by_name(GST_BIN(bin), kAfterConvert);
  GstPad *src = borrow_pad(before, "src"), *sink = borrow_pad(after, "sink");
  g_autoptr(GstPad) behind = gst_pad_get_peer(src);
  g_autoptr(GstPad) in_front = gst_pad_get_peer(sink);
  if (behind) gst_pad_unlink(src, behind);
  if (in_front) gst_pad_unlink(in_front, sink);
  gst_pad_link_full(src, sink, GST_PAD_LINK_CHECK_NOTHING);
}

// Links a new pad to the sink pad of `next`, unless that pad is already linked. The link is unchecked on purpose: a
// picture of the wrong size then reaches the size check, which posts a clear error.
void link_new_pad(GstPad* pad, GstElement* next) {
  GstPad* sink = borrow_pad(next, "sink");
  if (!gst_pad_is_linked(sink)) gst_pad_link_full(pad, sink, GST_PAD_LINK_CHECK_NOTHING);
}

bool is_media(GstPad* pad, const char* prefix) {
  g_autoptr(GstCaps) caps = gst_pad_query_caps(pad, nullptr);
  return !gst_caps_is_empty(caps) && !gst_caps_is_any(caps) &&
         g_str_has_prefix(gst_structure_get_name(gst_caps_get_structure(caps, 0)), prefix);
}

bool is_on_gpu(GstPad* pad) {
  g_autoptr(GstCaps) caps = gst_pad_query_caps(pad, nullptr);
  return !gst_caps_is_empty(caps) && !gst_caps_is_any(caps) &&
         gst_caps_features_contains(gst_caps_get_features(caps, 0), LF_GL_MEMORY);
}

// Returns true if downstream of the last identity accepts the pictures of the pad unchanged.
bool takes_pictures(GstElement* before, GstPad* pad) {
  g_autoptr(GstObject) bin = gst_element_get_parent(before);
  if (!bin) return false;
  g_autoptr(GstElement) after = gst_bin_get_by_name(GST_BIN(bin), kAfterConvert);
  g_autoptr(GstCaps) given = gst_pad_query_caps(pad, nullptr);
  g_autoptr(GstCaps) taken = gst_pad_peer_query_caps(borrow_pad(after, "src"), given);
  return !gst_caps_is_empty(taken);
}

template <typename F>
void for_each_source_pad(GstBin* bin, F f) {
  const GstElementForeachPadFunc call_f = [](GstElement*, GstPad* pad, gpointer data) -> gboolean {
    (*static_cast<F*>(data))(pad);
    return TRUE;
  };
  for (const ElementPtr& element : take_elements(gst_bin_iterate_recurse(bin)))
    gst_element_foreach_src_pad(element.get(), call_f, &f);
}

// Returns the rotation of the film that the tags of its demuxer state. Call this when the pads exist: demuxers send
// these tags before the first picture.
GstVideoOrientationMethod film_orientation(GstBin* bin) {
  GstVideoOrientationMethod turn = GST_VIDEO_ORIENTATION_IDENTITY;
  for_each_source_pad(bin, [&turn](GstPad* pad) {
    if (turn == GST_VIDEO_ORIENTATION_IDENTITY) turn = orientation_of(pad);
  });
  return turn;
}

// Links a decoder to `head`. GPU pictures pass gldownload on the way, and rotated pictures pass videoflip.
void link_decoded(GstElement* decoder, GstPad* pad, GstElement* head, bool on_gpu) {
  g_autoptr(GstObject) bin = gst_element_get_parent(head);
  if (!bin) return;
  try {
    const GstVideoOrientationMethod turn = film_orientation(GST_BIN(bin));
    std::vector<GstElement*> between;
    if (on_gpu) between.push_back(add(GST_BIN(bin), "gldownload"));
    if (turn != GST_VIDEO_ORIENTATION_IDENTITY) {
      between.push_back(add(GST_BIN(bin), "videoconvert"));
      between.push_back(add(GST_BIN(bin), "videoflip"));
      g_object_set(between.back(), "video-direction", turn, nullptr);
    }
    GstElement* next = head;
    for (auto element = between.rbegin(); element != between.rend(); ++element) {
      append(*element, next);
      gst_element_sync_state_with_parent(*element);
      next = *element;
    }
    link_new_pad(pad, next);
  } catch (const MissingElement& missing) {
    GST_ELEMENT_ERROR(decoder, CORE, MISSING_PLUGIN, ("element %s is not installed", missing.what()), (nullptr));
  }
}

// Signal handlers for new pads. They link the first video stream to `head`, the first element behind the decoders. This
// handler is for decoders.
void on_decoded_pad(GstElement* decoder, GstPad* pad, gpointer head_element) {
  GstElement* const head = GST_ELEMENT(head_element);
  if (gst_pad_is_linked(borrow_pad(head, "sink"))) return;
  const bool is_raw = is_media(pad, "video/x-raw"), on_gpu = is_raw && is_on_gpu(pad);
  const bool passes = may_bypass(head) && (on_gpu ? takes_pictures(head, pad) : is_media(pad, "image/jpeg"));
  if (passes) bypass(head);
  if (passes)
    link_new_pad(pad, head);
  else if (is_raw)
    link_decoded(decoder, pad, head, on_gpu);
}

// Handler for matroskademux. MJPEG stays JPEG, or jpegdec decodes it in the demuxer's thread. Other codecs use
// decodebin, which adds queues and threads.
void on_matroska_pad(GstElement* demuxer, GstPad* pad, gpointer head) {
  if (may_bypass(GST_ELEMENT(head)) && is_media(pad, "image/jpeg")) return on_decoded_pad(demuxer, pad, head);
  GstPad* sink = borrow_pad(GST_ELEMENT(head), "sink");
  if (gst_pad_is_linked(sink) || !(is_media(pad, "video/") || is_media(pad, "image/"))) return;
  if (is_media(pad, "video/x-raw")) return link_new_pad(pad, GST_ELEMENT(head));

  g_autoptr(GstObject) bin = gst_element_get_parent(demuxer);
  if (!bin) return;
  GstElement* decoder = nullptr;
  try {
    if (is_media(pad, "image/jpeg")) {
      decoder = add_jpeg_decoder(GST_BIN(bin));
      append(decoder, GST_ELEMENT(head));
    } else {
      decoder = add(GST_BIN(bin), "decodebin");
      g_signal_connect(decoder, "pad-added", G_CALLBACK(lf::callback<on_decoded_pad>), head);
    }
    gst_element_sync_state_with_parent(decoder);
    link_new_pad(pad, decoder);
  } catch (const MissingElement& missing) {
    GST_ELEMENT_ERROR(demuxer, CORE, MISSING_PLUGIN, ("element %s is not installed", missing.what()), (nullptr));
  }
}

// Posts an error if there was no video.
void on_no_more_pads(GstElement* element, gpointer /*unused*/) {
  bool linked = false;
  GST_OBJECT_LOCK(element);
  for (GList* pad = element->srcpads; pad; pad = pad->next) linked |= GST_PAD_IS_LINKED(GST_PAD(pad->data));
  GST_OBJECT_UNLOCK(element);
  if (!linked)
    GST_ELEMENT_ERROR(element, STREAM, WRONG_TYPE,
                      ("the source has no video stream: name a video, an image or a camera"), (nullptr));
}

// --- Sources ---------------------------------------------------------------------------------------------------------

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

GstElement* add_decodebin(GstBin* bin, const char* factory, GstElement* convert) {
  GstElement* decoder = add(bin, factory);
  // Caps with ANY are required here, because otherwise decoders that also support interlaced or GPU output are not
  // selected.
  g_autoptr(GstCaps) caps =
      gst_caps_from_string(may_bypass(convert) ? "image/jpeg; video/x-raw(ANY)" : "video/x-raw(ANY)");
  g_object_set(decoder, "caps", caps, "expose-all-streams", FALSE, nullptr);
  g_signal_connect(decoder, "pad-added", G_CALLBACK(lf::callback<on_decoded_pad>), convert);
  g_signal_connect(decoder, "no-more-pads", G_CALLBACK(lf::callback<on_no_more_pads>), nullptr);
  return decoder;
}

// Counts the bytes that an element has received since its last output, because demuxers, depayloaders and parsers
// collect an incomplete picture without limit.
class UnparsedBytes {
 public:
  static constexpr size_t kMost = size_t{64} << 20;
  void add(size_t bytes) { bytes_ += bytes; }
  void clear() { bytes_ = 0; }
  bool exceeds_limit() const { return bytes_ > kMost; }
  bool should_log() { return !logged_.exchange(true); }

 private:
  std::atomic<size_t> bytes_ = 0;
  std::atomic<bool> logged_ = false;
};
using UnparsedBytesPtr = std::shared_ptr<UnparsedBytes>;

GstPadProbeReturn count_bytes(GstPad* pad, GstPadProbeInfo* info, UnparsedBytes& unused) {
  const bool is_list = info->type & GST_PAD_PROBE_TYPE_BUFFER_LIST;
  unused.add(is_list ? gst_buffer_list_calculate_size(GST_PAD_PROBE_INFO_BUFFER_LIST(info))
                     : gst_buffer_get_size(GST_PAD_PROBE_INFO_BUFFER(info)));
  if (!unused.exceeds_limit()) return GST_PAD_PROBE_OK;
  g_autoptr(GstElement) source = gst_pad_get_parent_element(pad);
  if (source && unused.should_log())
    GST_ELEMENT_ERROR(source, STREAM, DEMUX,
                      ("more than %zu MB received without a picture: check that the URI is a video in a supported "
                       "format",
                       UnparsedBytes::kMost >> 20),
                      (nullptr));
  return GST_PAD_PROBE_DROP;
}

void count_input(GstPad* pad, const UnparsedBytesPtr& unused) {
  add_probe(pad, kData, [unused](GstPad* at, GstPadProbeInfo* info) { return count_bytes(at, info, *unused); });
}

void clear_at_output(GstPad* pad, const UnparsedBytesPtr& unused) {
  add_probe(pad, kData, [unused](GstPad*, GstPadProbeInfo*) { return unused->clear(), GST_PAD_PROBE_OK; });
}

// Limits the data that a depayloader or parser collects for one output, so that a broken stream cannot exhaust the
// memory.
void limit_element(GstBin* /*bin*/, GstBin* /*parent*/, GstElement* element, gpointer /*unused*/) {
  const gchar* klass = gst_element_get_metadata(element, GST_ELEMENT_METADATA_KLASS);
  if (!klass || !(std::strstr(klass, "Depayloader") || std::strstr(klass, "Parser"))) return;
  g_autoptr(GstPad) sink = gst_element_get_static_pad(element, "sink");
  g_autoptr(GstPad) src = gst_element_get_static_pad(element, "src");
  if (!sink || !src) return;
  const auto unused = std::make_shared<UnparsedBytes>();
  count_input(sink, unused);
  clear_at_output(src, unused);
}

// Applies this limit to all depayloaders and parsers in `bin`, also to elements that appear later.
void limit_collected_data(GstBin* bin) {
  constexpr const char* kLimited = "lightfield-limited";
  if (g_object_get_data(G_OBJECT(bin), kLimited)) return;
  g_object_set_data(G_OBJECT(bin), kLimited, bin);
  g_signal_connect(bin, "deep-element-added", G_CALLBACK(lf::callback<limit_element>), nullptr);
}

struct SourceSetup {
  GstClockTime latency;
  std::shared_ptr<SenderClock> sender;
  UnparsedBytesPtr unused;
};

void on_source_setup(GstElement* /*decoder*/, GstElement* source, gpointer data) {
  const auto* setup = static_cast<SourceSetup*>(data);
  if (g_object_class_find_property(G_OBJECT_GET_CLASS(source), "latency"))
    g_object_set(source, "latency", static_cast<guint>(setup->latency / GST_MSECOND), nullptr);
  if (setup->sender) setup->sender->watch(source);
  g_autoptr(GstPad) pad = gst_element_get_static_pad(source, "src");
  if (setup->unused && pad) count_input(pad, setup->unused);
}

// Works around a bug of GStreamer 1.22: uridecodebin does not disconnect from its decodebin, which messages on the bus
// can keep alive. A remaining pad would then be removed from a freed element.
void forget_decodebin(gpointer data, GObject* uridecodebin) {
  const std::unique_ptr<WeakRef<GstElement>> decodebin(static_cast<WeakRef<GstElement>*>(data));
  if (const ElementPtr alive = decodebin->get()) g_signal_handlers_disconnect_by_data(alive.get(), uridecodebin);
}

void on_child_of_uridecodebin(GstBin* uridecodebin, GstElement* child, gpointer /*unused*/) {
  GstElementFactory* factory = gst_element_get_factory(child);
  if (!factory || std::strcmp(GST_OBJECT_NAME(factory), "decodebin") != 0) return;
  g_object_weak_ref(G_OBJECT(uridecodebin), forget_decodebin, new WeakRef(child));
}

// Refuses files of this machine, which a playlist (HLS) from the network must not open.
void refuse_file(GstBin* uridecodebin, GstBin* /*parent*/, GstElement* child, gpointer /*unused*/) {
  GstElementFactory* factory = gst_element_get_factory(child);
  if (!factory || std::strcmp(GST_OBJECT_NAME(factory), "filesrc") != 0) return;
  g_autoptr(GstPad) pad = gst_element_get_static_pad(child, "src");
  const auto drop = [](GstPad*, GstPadProbeInfo*, gpointer) { return GST_PAD_PROBE_DROP; };
  gst_pad_add_probe(pad, GST_PAD_PROBE_TYPE_BUFFER, drop, nullptr, nullptr);
  GST_ELEMENT_ERROR(uridecodebin, RESOURCE, NOT_AUTHORIZED,
                    ("its playlist names a file of this machine, which a playlist from the network must not read"),
                    (nullptr));
}

// Returns the sender clock of an RTSP source. Null for other sources.
std::shared_ptr<SenderClock> add_uri_decoder(GstBin* bin, const std::string& uri, const CamSrcSettings& settings,
                                             GstElement* convert) {
  GstElement* decoder = add_decodebin(bin, "uridecodebin", convert);
  g_signal_connect(decoder, "element-added", G_CALLBACK(lf::callback<on_child_of_uridecodebin>), nullptr);
  g_object_set(decoder, "uri", uri.c_str(), nullptr);
  std::shared_ptr<SenderClock> sender;
  if (g_str_has_prefix(uri.c_str(), "rtsp")) sender = std::make_shared<SenderClock>(settings.latency);
  UnparsedBytesPtr unused;
  if (!g_str_has_prefix(uri.c_str(), "file:")) {
    g_signal_connect(decoder, "deep-element-added", G_CALLBACK(lf::callback<refuse_file>), nullptr);
    unused = std::make_shared<UnparsedBytes>();
    clear_at_output(borrow_pad(convert, "sink"), unused);
  }
  g_signal_connect_data(
      decoder, "source-setup", G_CALLBACK(callback<on_source_setup>), new SourceSetup{settings.latency, sender, unused},
      [](gpointer setup, GClosure*) { delete static_cast<SourceSetup*>(setup); }, GConnectFlags(0));
  return sender;
}

// Returns caps in the size of the rig for a device, which otherwise chooses its largest size. If JPEG video stays JPEG,
// JPEG comes first.
GstCaps* device_caps(const Camera& camera, const CamSrcSettings& settings) {
  GstCaps* caps = gst_caps_from_string(settings.decode ? "video/x-raw; image/jpeg; video/x-h264"
                                                       : "image/jpeg; video/x-raw; video/x-h264");
  gst_caps_set_simple(caps, "width", G_TYPE_INT, camera.width, "height", G_TYPE_INT, camera.height, nullptr);
  if (settings.fps_n > 0)
    gst_caps_set_simple(caps, "framerate", GST_TYPE_FRACTION, settings.fps_n, settings.fps_d, nullptr);
  return caps;
}

GstElement* add_device(GstBin* bin, const std::string& uri, const Camera& camera, const CamSrcSettings& settings,
                       GstElement* convert) {
  g_autoptr(GError) error = nullptr;
  GstElement* device = gst_element_make_from_uri(GST_URI_SRC, uri.c_str(), nullptr, &error);
  if (!device) throw Error(error->message);
  gst_bin_add(bin, device);
  append(append(device, add_capsfilter(bin, device_caps(camera, settings))), add_decodebin(bin, "decodebin", convert));
  return device;
}

// Returns caps for a launch description: raw video, also in GPU memory, and JPEG, in the size of the rig. Other coded
// video has no size, because parsers and depayloaders may not know the size.
GstCaps* bin_caps(const Camera& camera, const CamSrcSettings& settings) {
  GstCaps* caps = device_caps(camera, settings);
  GstStructure* raw = gst_structure_copy(gst_caps_get_structure(caps, settings.decode ? 0 : 1));
  gst_structure_set(raw, "texture-target", G_TYPE_STRING, "2D", nullptr);
  gst_caps_append_structure_full(caps, raw, gst_caps_features_new(LF_GL_MEMORY, nullptr));
  gst_caps_append(caps, gst_caps_from_string("image/jpeg; video/x-h264; video/x-h265; video/mpeg; video/x-vp8"));
  return caps;
}

GstElement* add_described(GstBin* bin, const std::string& line, const Camera& camera, const CamSrcSettings& settings,
                          GstElement* convert) {
  g_autoptr(GstElement) described = make_described_source(line, settings.trusted);
  gst_bin_add(bin, described);
  append(append(described, add_capsfilter(bin, bin_caps(camera, settings))), add_decodebin(bin, "decodebin", convert));
  return described;
}

void add_matroska_reader(GstBin* bin, const std::string& path, GstElement* convert) {
  GstElement* reader = add_file_reader(bin, path);
  GstElement* demuxer = append(reader, add(bin, "matroskademux"));
  g_signal_connect(demuxer, "pad-added", G_CALLBACK(lf::callback<on_matroska_pad>), convert);
  g_signal_connect(demuxer, "no-more-pads", G_CALLBACK(lf::callback<on_no_more_pads>), nullptr);
}

std::string file_uri(const std::string& path) {
  g_autoptr(GError) error = nullptr;
  g_autofree gchar* uri = gst_filename_to_uri(path.c_str(), &error);
  if (!uri) throw Error(path + ": " + error->message);
  return uri;
}

void add_pictures(GstBin* bin, const CameraSource& source, const Camera& camera, const CamSrcSettings& settings,
                  int fps_n, int fps_d, GstElement* convert, const std::shared_ptr<std::atomic<guint64>>& damaged) {
  const bool passes = may_bypass(convert) && source.codec == CameraSource::Codec::kJpeg;
  if (passes) bypass(convert);
  GstElement* pictures = new_picture_source(source, {.width = camera.width,
                                                     .height = camera.height,
                                                     .fps_n = fps_n,
                                                     .fps_d = fps_d,
                                                     .loop = settings.loop,
                                                     .decode = !passes,
                                                     .damaged = damaged});
  gst_bin_add(bin, pictures);
  append(pictures, convert);
}

void add_scene(GstBin* bin, const Camera& camera, int fps_n, int fps_d, bool live, GstElement* convert) {
  GstElement* scene = new_scene_source(camera, fps_n, fps_d, live);
  gst_bin_add(bin, scene);
  append(scene, convert);
}

void add_reader(GstBin* bin, const CameraSource& source, const Camera& camera, const CamSrcSettings& settings,
                int fps_n, int fps_d, GstElement* convert, CameraChain* chain) {
  switch (source.kind) {
    case Kind::kStill:
      if (source.codec == CameraSource::Codec::kOther) {
        if (const std::string problem = still_decoding_problem(source.location); !problem.empty()) throw Error(problem);
        add_uri_decoder(bin, file_uri(source.location), settings, convert);
        break;
      }
      [[fallthrough]];
    case Kind::kSequence:
    case Kind::kJpegStream: add_pictures(bin, source, camera, settings, fps_n, fps_d, convert, chain->damaged); break;
    case Kind::kMatroska: add_matroska_reader(bin, source.location, convert); break;
    case Kind::kFile: add_uri_decoder(bin, file_uri(source.location), settings, convert); break;
    case Kind::kDevice: chain->device = add_device(bin, source.location, camera, settings, convert); break;
    case Kind::kBin: chain->device = add_described(bin, source.location, camera, settings, convert); break;
    case Kind::kUri: chain->sender = add_uri_decoder(bin, source.location, settings, convert); break;
    case Kind::kScene: add_scene(bin, camera, fps_n, fps_d, settings.is_live, convert); break;
  }
}

}  // namespace

CameraSource find_playable_source(const Rig& rig, const Camera& camera) {
  CameraSource source = find_camera_source(rig, camera);
  if (source.kind == CameraSource::Kind::kUri && has_picture_pad(source.location))
    source.kind = CameraSource::Kind::kDevice;
  return source;
}

GstVideoOrientationMethod orientation_of(GstPad* pad) {
  GstVideoOrientationMethod turn = GST_VIDEO_ORIENTATION_IDENTITY;
  for (guint i = 0; turn == GST_VIDEO_ORIENTATION_IDENTITY; i++) {
    g_autoptr(GstEvent) event = gst_pad_get_sticky_event(pad, GST_EVENT_TAG, i);
    if (!event) break;
    GstTagList* tags = nullptr;
    gst_event_parse_tag(event, &tags);
    gst_video_orientation_from_tag(tags, &turn);
  }
  return turn;
}

bool has_sound(GstBin* bin) {
  bool found = false;
  for_each_source_pad(bin, [&found](GstPad* pad) { found |= is_media(pad, "audio/"); });
  return found;
}

CameraChain build_camera_chain(GstBin* bin, const CameraSource& source, const Camera& camera,
                               const CamSrcSettings& settings, const Controls& controls) {
  if (source.kind == Kind::kUri || source.kind == Kind::kDevice || source.kind == Kind::kBin) limit_collected_data(bin);
  const bool own_rate = settings.fps_n == 0;
  const int fps_n = own_rate ? kDefaultFps : settings.fps_n;
  const int fps_d = own_rate ? 1 : settings.fps_d;
  GstElement* convert = add(bin, "videoconvert");
  CameraChain chain;
  const auto append_to_tail = [&](GstElement* next) { chain.tail.push_back(append(chain.tail.back(), next)); };
  if (settings.decode || source.kind == Kind::kStill || source.kind == Kind::kScene) {
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
  add_reader(bin, source, camera, settings, fps_n, fps_d, chain.tail.front(), &chain);
  if (chain.device) apply_controls(chain.device, controls);
  const bool has_rate = source.kind == Kind::kMatroska || source.kind == Kind::kFile || source.kind == Kind::kUri;
  if (has_rate && !own_rate) append_to_tail(add(bin, "videorate"));
  if (source.kind == Kind::kStill || (has_rate && !own_rate))
    append_to_tail(add_capsfilter(bin, frame_rate_caps(fps_n, fps_d)));
  if (settings.is_live && source.kind != Kind::kDevice) append_to_tail(add(bin, "clocksync"));
  chain.out = borrow_pad(chain.tail.back(), "src");
  return chain;
}

}  // namespace lf
