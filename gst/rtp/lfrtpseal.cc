// SPDX-License-Identifier: LGPL-2.1-or-later
/**
 * SECTION:element-lfrtpseal
 * @title: lfrtpseal
 * @short_description: encrypts and authenticates RTP packets with a shared key
 *
 * lfrtpseal encrypts and authenticates RTP packets of any kind: requests, answers or pictures. Place it in front of
 * `udpsink`. It applies SRTP (`srtpenc`) with keys that it derives from the secret in #lfrtpseal:key-file. Give all
 * hosts the same file. The receiver decrypts the packets with #element-lfrtpgate. Without a key file, packets pass
 * unchanged.
 *
 * Create the file with `openssl rand -hex 32`; it must have 32 or more random characters. The contents never appear on
 * command lines, in logs or in properties. Each derived key is valid for one kind of stream and for about one minute. A
 * receiver can therefore start at any time, and it rejects packets that an attacker has recorded and sends again later.
 * For this reason, the clocks of all hosts must differ by less than a minute.
 *
 * Packets grow by 22 bytes. The element replaces their SSRC and sequence numbers, so place it after elements that use
 * these numbers, such as `rtpbin`.
 *
 * ## Encrypted pictures
 * |[
 * gst-launch-1.0 videotestsrc is-live=true ! jpegenc ! rtpjpegpay ! lfrtpseal key-file=lightfield.key ! \
 *   udpsink host=VIEWER port=6300
 * ]|
 */
#include <gst/gst.h>

#include <gst/rtp/gstrtpbuffer.h>

#include <algorithm>
#include <memory>
#include <string>
#include <utility>

#include "base/text.h"
#include "common/properties.h"
#include "rtp/srtp.h"

GST_DEBUG_CATEGORY_STATIC(lf_rtp_seal_debug);
#define GST_CAT_DEFAULT lf_rtp_seal_debug

namespace {

struct Settings {
  std::string key_file;

  static lf::PropertyTable<Settings>& properties() {
    static lf::PropertyTable<Settings> table = {lf::property<&Settings::key_file>(
        lf::kWhileReady, "key-file", "Key file",
        "Path of the file with the secret that all hosts share (32 or more random characters). The receiving lfrtpgate "
        "needs the same file. If the file has several secrets, one per line, the first is used. A changed file is read "
        "again (empty: packets pass unchanged, without encryption)")};
    return table;
  }
};

// Maximum number of packets in a stream. A later receiver could not know how often sequence numbers have wrapped.
constexpr guint kPacketsOfStream = 1 << 16;
constexpr guint kPacketsWithoutMarker = 1 << 12;  // a new minute waits at most this long for the end of a frame

struct Stream {
  lf::rtp::KeyId name;
  guint packets = 0;
  std::unique_ptr<lf::rtp::StandaloneElement> srtpenc;
};

}  // namespace

#define LF_TYPE_RTP_SEAL (lf_rtp_seal_get_type())
G_DECLARE_FINAL_TYPE(LfRtpSeal, lf_rtp_seal, LF, RTP_SEAL, GstElement)

struct _LfRtpSeal {
  GstElement parent;
  GstPad *sink, *src;
  Settings* settings;  // guarded by the object lock

  lf::rtp::KeyFile* keys;
  // Streaming thread:
  std::string* purpose;
  Stream* stream;
  gboolean between_frames;
  gboolean sealed;  // srtpenc has returned the current data
};

G_DEFINE_FINAL_TYPE(LfRtpSeal, lf_rtp_seal, GST_TYPE_ELEMENT)
GST_ELEMENT_REGISTER_DEFINE_WITH_CODE(lfrtpseal, "lfrtpseal", GST_RANK_NONE, LF_TYPE_RTP_SEAL,
                                      GST_DEBUG_CATEGORY_INIT(lf_rtp_seal_debug, "lfrtpseal", 0,
                                                              "encryption of RTP packets"))

static GstStaticPadTemplate sink_template =
    GST_STATIC_PAD_TEMPLATE("sink", GST_PAD_SINK, GST_PAD_ALWAYS, GST_STATIC_CAPS("application/x-rtp"));
static GstStaticPadTemplate src_template = GST_STATIC_PAD_TEMPLATE(
    "src", GST_PAD_SRC, GST_PAD_ALWAYS, GST_STATIC_CAPS("application/x-rtp; application/x-srtp"));

static void begin_stream(LfRtpSeal* self) {
  Stream stream;
  stream.name = {g_random_int(), lf::rtp::current_minute(), g_random_int()};
  const lf::rtp::SessionKey session = self->keys->keys().front()->session(*self->purpose, stream.name);
  GstElement* srtpenc = gst_element_factory_make("srtpenc", nullptr);
  if (!srtpenc) throw lf::Error("element srtpenc is not installed (it is in gstreamer1.0-plugins-bad)");
  g_autoptr(GstBuffer) key = gst_buffer_new_memdup(session.key.data(), session.key.size());
  g_autoptr(GstBuffer) mki = gst_buffer_new_memdup(session.mki.data(), session.mki.size());
  g_object_set(srtpenc, "key", key, "mki", mki, nullptr);
  stream.srtpenc = std::make_unique<lf::rtp::StandaloneElement>(
      srtpenc, "rtp_sink_0", "rtp_src_0", "application/x-rtp",
      [self](GstBuffer* packet) {
        self->sealed = TRUE;
        return gst_pad_push(self->src, packet);
      },
      [self](GstBufferList* packets) {
        self->sealed = TRUE;
        return gst_pad_push_list(self->src, packets);
      });
  *self->stream = std::move(stream);
}

// Returns true if there are new keys.
static bool refresh_keys(LfRtpSeal* self) {
  try {
    return self->keys->refresh();
  } catch (const lf::Error& error) {
    GST_ELEMENT_WARNING(self, RESOURCE, READ, ("key-file: %s. The previous key remains in use.", error.what()),
                        (nullptr));
    return false;
  }
}

// Starts a new stream with a new key when this is due. The change happens between frames, or within a frame that is too
// long.
static void choose_stream(LfRtpSeal* self, guint packets) {
  const Stream& stream = *self->stream;
  if (self->between_frames && refresh_keys(self)) begin_stream(self);
  const bool is_old = stream.name.minute != lf::rtp::current_minute() &&
                      (self->between_frames || stream.packets >= kPacketsWithoutMarker);
  if (!stream.srtpenc || is_old || stream.packets + packets > kPacketsOfStream) begin_stream(self);
}

// Gives the packet the SSRC and the sequence number of the stream. Takes and returns the packet; null if it is not RTP.
static GstBuffer* number(LfRtpSeal* self, GstBuffer* packet) {
  packet = gst_buffer_make_writable(packet);
  GstRTPBuffer rtp = GST_RTP_BUFFER_INIT;
  if (!gst_rtp_buffer_map(packet, GST_MAP_READWRITE, &rtp)) {
    gst_buffer_unref(packet);
    return nullptr;
  }
  Stream& stream = *self->stream;
  gst_rtp_buffer_set_ssrc(&rtp, stream.name.ssrc);
  gst_rtp_buffer_set_seq(&rtp, static_cast<guint16>(stream.packets++));
  self->between_frames = gst_rtp_buffer_get_marker(&rtp);
  gst_rtp_buffer_unmap(&rtp);
  return packet;
}

template <typename Packets>
static GstFlowReturn push_numbered(LfRtpSeal* self, Packets* packets) {
  self->sealed = FALSE;
  const GstFlowReturn flow = self->stream->srtpenc->push(packets);
  if (flow == GST_FLOW_ERROR && !self->sealed)
    GST_ELEMENT_ERROR(self, LIBRARY, FAILED,
                      ("The element srtpenc rejects the packets, so they cannot be encrypted "
                       "and sent."),
                      (nullptr));
  return flow;
}

static GstFlowReturn lf_rtp_seal_chain(GstPad*, GstObject* parent, GstBuffer* packet) {
  LfRtpSeal* self = LF_RTP_SEAL(parent);
  if (!self->keys) return gst_pad_push(self->src, packet);
  choose_stream(self, 1);
  packet = number(self, packet);
  return packet ? push_numbered(self, packet) : GST_FLOW_OK;
}

static GstFlowReturn lf_rtp_seal_chain_list(GstPad*, GstObject* parent, GstBufferList* packets) {
  LfRtpSeal* self = LF_RTP_SEAL(parent);
  if (!self->keys) return gst_pad_push_list(self->src, packets);
  const guint count = std::min(gst_buffer_list_length(packets), kPacketsOfStream);
  choose_stream(self, count);
  GstBufferList* numbered = gst_buffer_list_new_sized(count);
  for (guint i = 0; i < count; i++)
    if (GstBuffer* packet = number(self, gst_buffer_ref(gst_buffer_list_get(packets, i))))
      gst_buffer_list_add(numbered, packet);
  gst_buffer_list_unref(packets);
  return push_numbered(self, numbered);
}

static gboolean take_caps(LfRtpSeal* self, GstCaps* caps) {
  g_autoptr(GstCaps) own = gst_caps_copy(caps);
  GstStructure* structure = gst_caps_get_structure(own, 0);
  if (self->keys) {
    const gchar* encoding = gst_structure_get_string(structure, "encoding-name");
    const std::string purpose = encoding ? encoding : "";
    if (*self->purpose != purpose) *self->stream = {};
    *self->purpose = purpose;
    gst_structure_set_name(structure, "application/x-srtp");
    gst_structure_remove_fields(structure, "ssrc", "seqnum-base", "seqnum-offset", nullptr);
  }
  return gst_pad_push_event(self->src, gst_event_new_caps(own));
}

static gboolean lf_rtp_seal_event(GstPad* pad, GstObject* parent, GstEvent* event) {
  if (GST_EVENT_TYPE(event) != GST_EVENT_CAPS) return gst_pad_event_default(pad, parent, event);
  GstCaps* caps = nullptr;
  gst_event_parse_caps(event, &caps);
  const gboolean done = take_caps(LF_RTP_SEAL(parent), caps);
  gst_event_unref(event);
  return done;
}

static Settings& settings_of(LfRtpSeal* self) { return *self->settings; }
using Properties = lf::Properties<settings_of>;

// Loads the key. Returns false after posting an error.
static bool read_key(LfRtpSeal* self) {
  const std::string path = Properties::now(self).key_file;
  delete std::exchange(self->keys, nullptr);
  if (path.empty()) return true;
  try {
    self->keys = new lf::rtp::KeyFile(path);
    begin_stream(self);  // throws if srtpenc is missing
    *self->stream = {};
    return true;
  } catch (const lf::Error& error) {
    GST_ELEMENT_ERROR(self, RESOURCE, SETTINGS, ("key-file: %s", error.what()), (nullptr));
    return false;
  }
}

static GstStateChangeReturn lf_rtp_seal_change_state(GstElement* element, GstStateChange transition) {
  LfRtpSeal* self = LF_RTP_SEAL(element);
  if (transition == GST_STATE_CHANGE_READY_TO_PAUSED && !read_key(self)) return GST_STATE_CHANGE_FAILURE;
  const GstStateChangeReturn result = GST_ELEMENT_CLASS(lf_rtp_seal_parent_class)->change_state(element, transition);
  if (transition == GST_STATE_CHANGE_PAUSED_TO_READY) {
    *self->stream = {};
    self->between_frames = TRUE;
    delete std::exchange(self->keys, nullptr);
  }
  return result;
}

static void lf_rtp_seal_finalize(GObject* object) {
  LfRtpSeal* self = LF_RTP_SEAL(object);
  delete self->keys;
  delete self->purpose;
  delete self->stream;
  delete self->settings;
  G_OBJECT_CLASS(lf_rtp_seal_parent_class)->finalize(object);
}

static void lf_rtp_seal_class_init(LfRtpSealClass* klass) {
  GObjectClass* object_class = G_OBJECT_CLASS(klass);
  object_class->finalize = lf_rtp_seal_finalize;
  Properties::install(object_class);
  GstElementClass* element_class = GST_ELEMENT_CLASS(klass);
  element_class->change_state = lf::callback<lf_rtp_seal_change_state>;
  gst_element_class_add_static_pad_template(element_class, &sink_template);
  gst_element_class_add_static_pad_template(element_class, &src_template);
  gst_element_class_set_static_metadata(element_class, "Light field RTP seal", "Filter/Network/SRTP",
                                        "Encrypts and authenticates RTP packets with a shared key (SRTP)",
                                        "gst-lightfield");
}

static void lf_rtp_seal_init(LfRtpSeal* self) {
  self->settings = new Settings;
  self->purpose = new std::string;
  self->stream = new Stream;
  self->between_frames = TRUE;
  self->sink = gst_pad_new_from_static_template(&sink_template, "sink");
  gst_pad_set_chain_function(self->sink, lf::callback<lf_rtp_seal_chain>);
  gst_pad_set_chain_list_function(self->sink, lf::callback<lf_rtp_seal_chain_list>);
  gst_pad_set_event_function(self->sink, lf::callback<lf_rtp_seal_event>);
  gst_element_add_pad(GST_ELEMENT(self), self->sink);
  self->src = gst_pad_new_from_static_template(&src_template, "src");
  gst_element_add_pad(GST_ELEMENT(self), self->src);
}
