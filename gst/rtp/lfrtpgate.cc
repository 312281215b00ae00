// SPDX-License-Identifier: LGPL-2.1-or-later
/**
 * SECTION:element-lfrtpgate
 * @title: lfrtpgate
 * @short_description: lets in RTP packets of those who may send, and drops and counts all others
 *
 * With #lfrtpgate:key-file those may who have the same secret: #element-lfrtpseal has put their packets under a key,
 * this takes them out, each once. What is not sealed, forged, damaged, cut short, sent again or more than a minute old
 * is dropped. Senders may begin anew at any time, and several may share a port. A packet passes one gate of a process,
 * once, unless #lfrtpgate:copies is set. Gates of other processes with the same key take the packet, too.
 *
 * Without a key those may who send from an address of #lfrtpgate:peers, which keeps out who is elsewhere by mistake,
 * but not who forges addresses; where nobody is named, the first address of loopback that sends. With a key peers count
 * if there are any.
 *
 * Behind `udpsrc`, whose caps say what the packets are (`encoding-name`, the same as at the sender). What is dropped is
 * in #lfrtpgate:stats, and in a warning, one in ten seconds at most.
 *
 * ## Pictures under a key
 * |[
 * gst-launch-1.0 udpsrc port=6300 caps="application/x-srtp,media=video,clock-rate=90000,encoding-name=JPEG" ! \
 *   lfrtpgate key-file=lightfield.key ! rtpjpegdepay ! jpegdec ! videoconvert ! autovideosink
 * ]|
 */
#include <gst/gst.h>

#include <gst/net/gstnetaddressmeta.h>

#include <array>
#include <memory>
#include <string>
#include <utility>

#include "base/text.h"
#include "common/properties.h"
#include "rtp/peers.h"
#include "rtp/srtp.h"

GST_DEBUG_CATEGORY_STATIC(lf_rtp_gate_debug);
#define GST_CAT_DEFAULT lf_rtp_gate_debug

namespace {

using lf::rtp::SealOpener;

struct Settings {
  std::string key_file, peers;
  bool copies = false;

  static lf::PropertyTable<Settings>& properties() {
    static lf::PropertyTable<Settings> table = {
        lf::property<&Settings::key_file>(lf::kWhileReady, "key-file", "Key file",
                                          "File with the secret that all hosts share: 32 or more random characters "
                                          "(none: packets are not sealed)"),
        lf::property<&Settings::peers>(
            lf::kWhileReady, "peers", "Peers",
            "Names, addresses and networks (10.0.0.0/24) that packets may come from, with commas between (none: of "
            "those who have the key, or, without a key, of the first address of loopback)"),
        lf::property<&Settings::copies>(
            lf::kWhileReady, "copies", "Copies",
            "Whether other gates of this process receive the same sealed packets, as those of a multicast group do "
            "(false: a packet passes one of them, once)"),
    };
    return table;
  }
};

// What becomes of a packet.
enum Fate { kPassed, kMalformed, kUnsealed, kStale, kReplayed, kForged, kStrangers, kNumFates };
constexpr std::array<const char*, kNumFates> kFateNames = {"passed",   "malformed", "unsealed", "stale",
                                                           "replayed", "forged",    "strangers"};
constexpr std::array<const char*, kNumFates> kFateWords = {
    "",
    "no RTP, or too short to be sealed",
    "not sealed: the sender has no key-file, or another one and a clock that is off",
    "sealed more than a minute ago or ahead: sent again, or the clocks of the two hosts differ",
    "sent again",
    "sealed with another key, or damaged",
    "of an address that is not among peers"};

constexpr gint64 kBetweenWarnings = 10 * G_USEC_PER_SEC;

}  // namespace

#define LF_TYPE_RTP_GATE (lf_rtp_gate_get_type())
G_DECLARE_FINAL_TYPE(LfRtpGate, lf_rtp_gate, LF, RTP_GATE, GstElement)

struct _LfRtpGate {
  GstElement parent;
  GstPad *sink, *src;

  // Object lock.
  Settings* settings;
  guint64 counts[kNumFates];
  guint64 streams;

  // From PAUSED on.
  std::shared_ptr<const lf::rtp::RtpKey>* key;  // null without a file
  bool copies;
  lf::Peers* peers;  // null: all that have the key
  // Streaming thread.
  SealOpener* opener;
  gint64 warned;  // monotonic time
};

G_DEFINE_FINAL_TYPE(LfRtpGate, lf_rtp_gate, GST_TYPE_ELEMENT)
GST_ELEMENT_REGISTER_DEFINE_WITH_CODE(lfrtpgate, "lfrtpgate", GST_RANK_NONE, LF_TYPE_RTP_GATE,
                                      GST_DEBUG_CATEGORY_INIT(lf_rtp_gate_debug, "lfrtpgate", 0, "who may send RTP"))

static GstStaticPadTemplate sink_template = GST_STATIC_PAD_TEMPLATE(
    "sink", GST_PAD_SINK, GST_PAD_ALWAYS, GST_STATIC_CAPS("application/x-rtp; application/x-srtp"));
static GstStaticPadTemplate src_template =
    GST_STATIC_PAD_TEMPLATE("src", GST_PAD_SRC, GST_PAD_ALWAYS, GST_STATIC_CAPS("application/x-rtp"));

static Fate to_fate(SealOpener::Result result) {
  switch (result) {
    case SealOpener::Result::kOpened: return kPassed;
    case SealOpener::Result::kMalformed: return kMalformed;
    case SealOpener::Result::kUnsealed: return kUnsealed;
    case SealOpener::Result::kStale: return kStale;
    case SealOpener::Result::kReplayed: return kReplayed;
    case SealOpener::Result::kForged: return kForged;
  }
  return kForged;
}

// Takes the packet; with kPassed *passed is what goes on.
static Fate judge(LfRtpGate* self, GstBuffer* packet, const std::optional<lf::Address>& sender, GstBuffer** passed) {
  if (self->peers && !(sender && self->peers->admits(*sender))) {
    gst_buffer_unref(packet);
    return kStrangers;
  }
  if (self->opener) return to_fate(self->opener->open(packet, passed));
  *passed = packet;
  return kPassed;
}

static void count(LfRtpGate* self, Fate fate, const std::optional<lf::Address>& sender) {
  GST_OBJECT_LOCK(self);
  self->counts[fate]++;
  self->streams = self->opener ? self->opener->streams() : 0;
  GST_OBJECT_UNLOCK(self);
  const gint64 now = g_get_monotonic_time();
  if (fate == kPassed || (self->warned && now < self->warned + kBetweenWarnings)) return;
  self->warned = now;
  const std::string from = sender ? " of " + lf::to_text(*sender) : "";
  GST_ELEMENT_WARNING(
      self, RESOURCE, READ,
      ("Packets%s are dropped: %s. (Further ones are counted in stats.)", from.c_str(), kFateWords[fate]), (nullptr));
}

static GstFlowReturn lf_rtp_gate_chain(GstPad*, GstObject* parent, GstBuffer* packet) {
  LfRtpGate* self = LF_RTP_GATE(parent);
  if (*self->key && !self->opener) {  // nothing passes that is not opened
    gst_buffer_unref(packet);
    GST_ELEMENT_ERROR(self, STREAM, FORMAT,
                      ("No caps say what is sealed: set them on the source of the packets, such as udpsrc caps=..."),
                      (nullptr));
    return GST_FLOW_NOT_NEGOTIATED;
  }
  const GstNetAddressMeta* meta = gst_buffer_get_net_address_meta(packet);
  const std::optional<lf::Address> sender = meta ? lf::address_of(meta->addr) : std::nullopt;
  GstBuffer* passed = nullptr;
  const Fate fate = judge(self, packet, sender, &passed);
  count(self, fate, sender);
  return passed ? gst_pad_push(self->src, passed) : GST_FLOW_OK;
}

static gboolean take_caps(LfRtpGate* self, GstCaps* caps) {
  caps = gst_caps_copy(caps);
  GstStructure* structure = gst_caps_get_structure(caps, 0);
  gst_structure_set_name(structure, "application/x-rtp");
  const gchar* encoding = gst_structure_get_string(structure, "encoding-name");
  delete std::exchange(self->opener, nullptr);
  if (*self->key) {
    const std::string purpose = encoding ? encoding : "";
    self->opener =
        new SealOpener(*self->key, purpose, self->copies ? nullptr : lf::rtp::OpenedPackets::of(**self->key, purpose));
  }
  const gboolean done = gst_pad_push_event(self->src, gst_event_new_caps(caps));
  gst_caps_unref(caps);
  return done;
}

static gboolean lf_rtp_gate_event(GstPad* pad, GstObject* parent, GstEvent* event) {
  if (GST_EVENT_TYPE(event) != GST_EVENT_CAPS) return gst_pad_event_default(pad, parent, event);
  GstCaps* caps = nullptr;
  gst_event_parse_caps(event, &caps);
  const gboolean done = take_caps(LF_RTP_GATE(parent), caps);
  gst_event_unref(event);
  return done;
}

// False after posting the reason.
static bool prepare(LfRtpGate* self) {
  lf::ObjectLock lock(self);
  const std::string path = self->settings->key_file, peers = self->settings->peers;
  self->copies = self->settings->copies;
  std::fill_n(self->counts, guint{kNumFates}, 0);
  self->streams = 0;
  lock.unlock();
  const char* what = "key-file";
  try {
    if (!path.empty()) {
      *self->key = std::make_shared<const lf::rtp::RtpKey>(path);
      SealOpener(*self->key, "", nullptr);  // says here that there is no srtpdec
    }
    what = "peers";
    if (path.empty() || !peers.empty()) self->peers = new lf::Peers(peers);
    self->warned = 0;
    return true;
  } catch (const lf::Error& error) {
    GST_ELEMENT_ERROR(self, RESOURCE, SETTINGS, ("%s: %s", what, error.what()), (nullptr));
    return false;
  }
}

static void forget(LfRtpGate* self) {
  delete std::exchange(self->opener, nullptr);
  delete std::exchange(self->peers, nullptr);
  self->key->reset();
}

static GstStateChangeReturn lf_rtp_gate_change_state(GstElement* element, GstStateChange transition) {
  LfRtpGate* self = LF_RTP_GATE(element);
  if (transition == GST_STATE_CHANGE_READY_TO_PAUSED && !prepare(self)) {
    forget(self);
    return GST_STATE_CHANGE_FAILURE;
  }
  const GstStateChangeReturn result = GST_ELEMENT_CLASS(lf_rtp_gate_parent_class)->change_state(element, transition);
  if (transition == GST_STATE_CHANGE_PAUSED_TO_READY) forget(self);
  return result;
}

static Settings& settings_of(LfRtpGate* self) { return *self->settings; }

static GstStructure* stats_of(LfRtpGate* self) {
  const lf::ObjectLock lock(self);
  GstStructure* stats = gst_structure_new("lightfield-gate-stats", "streams", G_TYPE_UINT64, self->streams, nullptr);
  for (guint fate = 0; fate < kNumFates; fate++)
    gst_structure_set(stats, kFateNames[fate], G_TYPE_UINT64, self->counts[fate], nullptr);
  return stats;
}

static void lf_rtp_gate_finalize(GObject* object) {
  LfRtpGate* self = LF_RTP_GATE(object);
  forget(self);
  delete self->key;
  delete self->settings;
  G_OBJECT_CLASS(lf_rtp_gate_parent_class)->finalize(object);
}

static void lf_rtp_gate_class_init(LfRtpGateClass* klass) {
  GObjectClass* object_class = G_OBJECT_CLASS(klass);
  object_class->finalize = lf_rtp_gate_finalize;
  lf::Properties<settings_of, stats_of>::install(
      object_class,
      "Packets since the start (all uint64): passed; dropped: malformed (no RTP, or too short to be "
      "sealed), unsealed (of senders without a key), stale (sealed more than a minute ago or ahead), replayed "
      "(have come before), forged (with another key, or damaged), strangers (of other addresses than peers). And "
      "streams: senders of the latest minutes who have the key");
  GstElementClass* element_class = GST_ELEMENT_CLASS(klass);
  element_class->change_state = lf::callback<lf_rtp_gate_change_state>;
  gst_element_class_add_static_pad_template(element_class, &sink_template);
  gst_element_class_add_static_pad_template(element_class, &src_template);
  gst_element_class_set_static_metadata(element_class, "Light field RTP gate", "Filter/Network/SRTP",
                                        "Lets in RTP packets of those who have the key, or of known addresses",
                                        "gst-lightfield");
}

static void lf_rtp_gate_init(LfRtpGate* self) {
  self->settings = new Settings;
  self->key = new std::shared_ptr<const lf::rtp::RtpKey>;
  self->sink = gst_pad_new_from_static_template(&sink_template, "sink");
  gst_pad_set_chain_function(self->sink, lf::callback<lf_rtp_gate_chain>);
  gst_pad_set_event_function(self->sink, lf::callback<lf_rtp_gate_event>);
  gst_element_add_pad(GST_ELEMENT(self), self->sink);
  self->src = gst_pad_new_from_static_template(&src_template, "src");
  gst_element_add_pad(GST_ELEMENT(self), self->src);
}
