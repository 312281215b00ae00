// SPDX-License-Identifier: LGPL-2.1-or-later
/**
 * SECTION:element-lfrtpgate
 * @title: lfrtpgate
 * @short_description: accepts RTP packets of allowed senders and drops all others
 *
 * lfrtpgate protects a receiver from packets of unknown senders. It forwards only the packets of allowed senders. Place
 * it after `udpsrc`, and set caps on `udpsrc` that describe the packets (`encoding-name`, as at the sender).
 *
 * If #lfrtpgate:key-file is set, the element decrypts the packets that #element-lfrtpseal has encrypted with the same
 * secret, and forwards each of them once. It drops packets that are not encrypted, and packets that are forged, damaged
 * or truncated. It also drops replayed packets, which an attacker has recorded and sent again, and packets more than a
 * minute old. Senders may restart at any time, and several senders may share a port.
 *
 * If a process has several lfrtpgate elements, a packet passes only one of them, unless #lfrtpgate:copies is set. Other
 * processes with the same key accept the packet, too.
 *
 * Without a key file, the element forwards packets from the addresses in #lfrtpgate:peers. This prevents accidents but
 * not attacks, because addresses can be forged. If `peers` is empty, too, only packets of this machine pass, from the
 * first loopback address that sends a packet. If both properties are set, packets must satisfy both.
 *
 * #lfrtpgate:stats counts dropped packets by reason. The element posts a warning about them at most every ten seconds.
 *
 * ## Encrypted pictures
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

using lf::rtp::SrtpDecryptor;

struct Settings {
  std::string key_file, peers;
  bool copies = false;

  static lf::PropertyTable<Settings>& properties() {
    static lf::PropertyTable<Settings> table = {
        lf::property<&Settings::key_file>(
            lf::kWhileReady, "key-file", "Key file",
            "Path of the file with the secret that all hosts share (32 or more random characters). If it is set, the "
            "element decrypts packets and drops every packet that lfrtpseal has not encrypted with the same secret. A "
            "file may have several secrets, one per line, which are all accepted. A changed file is read again (empty: "
            "packets are not encrypted)"),
        lf::property<&Settings::peers>(
            lf::kWhileReady, "peers", "Peers",
            "Comma-separated list of the hosts that may send packets, as names, addresses or networks such as "
            "10.0.0.0/24. If the list is empty, every host with the secret in `key-file` may send packets. Without a "
            "key file, only this machine may send packets, from the first loopback address (such as 127.0.0.1) that "
            "sends one"),
        lf::property<&Settings::copies>(
            lf::kWhileReady, "copies", "Copies",
            "If true, several lfrtpgate elements of this process can accept the same packet. Set this if these "
            "elements listen to one multicast group. If false, only the first element accepts a packet, because an "
            "attacker could record a packet and send it again to another element"),
    };
    return table;
  }
};

// The results of SrtpDecryptor::open(), and one more.
using PacketResult = size_t;
constexpr PacketResult kPassed = static_cast<size_t>(SrtpDecryptor::Result::kOpened), kUnknownSenders = 6,
                       kNumPacketResults = 7;
constexpr std::array<const char*, kNumPacketResults> kResultNames = {"passed",   "malformed", "unsealed",       "stale",
                                                                     "replayed", "forged",    "unknown-senders"};
constexpr std::array<const char*, kNumPacketResults> kResultTexts = {
    "",
    "not RTP, or too short for SRTP",
    "not encrypted: the sender has no key-file, or another key-file and a wrong clock",
    "timestamp more than a minute off: the packet is replayed, or the clocks of the two hosts differ (synchronise them "
    "by NTP)",
    "replayed",
    "encrypted with another key, or damaged: use the same key-file on both hosts",
    "unknown sender: the address is not in peers; add the host to peers if it may send"};

constexpr gint64 kBetweenWarnings = 10 * G_USEC_PER_SEC;

}  // namespace

#define LF_TYPE_RTP_GATE (lf_rtp_gate_get_type())
G_DECLARE_FINAL_TYPE(LfRtpGate, lf_rtp_gate, LF, RTP_GATE, GstElement)

struct _LfRtpGate {
  GstElement parent;
  GstPad *sink, *src;

  // Guarded by the object lock:
  Settings* settings;
  guint64 counts[kNumPacketResults];
  guint64 streams;

  // Set in PAUSED:
  bool copies;
  lf::Peers* peers;  // null: all holders of a key
  // Set in PAUSED, then used by the streaming thread:
  lf::rtp::KeyFile* keys;
  // Streaming thread:
  SrtpDecryptor* opener;
  gint64 warned;
};

G_DEFINE_FINAL_TYPE(LfRtpGate, lf_rtp_gate, GST_TYPE_ELEMENT)
GST_ELEMENT_REGISTER_DEFINE_WITH_CODE(lfrtpgate, "lfrtpgate", GST_RANK_NONE, LF_TYPE_RTP_GATE,
                                      GST_DEBUG_CATEGORY_INIT(lf_rtp_gate_debug, "lfrtpgate", 0,
                                                              "filter for RTP senders"))

static GstStaticPadTemplate sink_template = GST_STATIC_PAD_TEMPLATE(
    "sink", GST_PAD_SINK, GST_PAD_ALWAYS, GST_STATIC_CAPS("application/x-rtp; application/x-srtp"));
static GstStaticPadTemplate src_template =
    GST_STATIC_PAD_TEMPLATE("src", GST_PAD_SRC, GST_PAD_ALWAYS, GST_STATIC_CAPS("application/x-rtp"));

// Checks and decrypts a packet. Takes the packet. If the result is kPassed, *passed is the packet to forward.
static PacketResult classify(LfRtpGate* self, GstBuffer* packet, const std::optional<lf::Address>& sender,
                             GstBuffer** passed) {
  if (self->peers && !(sender && self->peers->admits(*sender))) {
    gst_buffer_unref(packet);
    return kUnknownSenders;
  }
  if (self->opener) return static_cast<PacketResult>(self->opener->open(packet, passed));
  *passed = packet;
  return kPassed;
}

static void count(LfRtpGate* self, PacketResult fate, const std::optional<lf::Address>& sender) {
  lf::ObjectLock lock(self);
  self->counts[fate]++;
  self->streams = self->opener ? self->opener->streams() : 0;
  lock.unlock();
  const gint64 now = g_get_monotonic_time();
  if (fate == kPassed || (self->warned && now < self->warned + kBetweenWarnings)) return;
  self->warned = now;
  const std::string from = sender ? " of " + lf::to_text(*sender) : "";
  GST_ELEMENT_WARNING(
      self, RESOURCE, READ,
      ("Packets%s are dropped: %s. (Further drops are counted in stats.)", from.c_str(), kResultTexts[fate]),
      (nullptr));
}

static void refresh_keys(LfRtpGate* self) {
  try {
    if (self->keys->refresh()) self->opener->set_keys(self->keys->keys());
  } catch (const lf::Error& error) {
    GST_ELEMENT_WARNING(self, RESOURCE, READ, ("key-file: %s. The previous keys remain valid.", error.what()),
                        (nullptr));
  }
}

static GstFlowReturn lf_rtp_gate_chain(GstPad*, GstObject* parent, GstBuffer* packet) {
  LfRtpGate* self = LF_RTP_GATE(parent);
  if (self->keys && !self->opener) {
    gst_buffer_unref(packet);
    GST_ELEMENT_ERROR(self, STREAM, FORMAT,
                      ("Missing caps: set caps on the source of the packets, such as udpsrc caps=..."), (nullptr));
    return GST_FLOW_NOT_NEGOTIATED;
  }
  if (self->keys) refresh_keys(self);
  const GstNetAddressMeta* meta = gst_buffer_get_net_address_meta(packet);
  const std::optional<lf::Address> sender = meta ? lf::address_of(meta->addr) : std::nullopt;
  GstBuffer* passed = nullptr;
  const PacketResult fate = classify(self, packet, sender, &passed);
  count(self, fate, sender);
  return passed ? gst_pad_push(self->src, passed) : GST_FLOW_OK;
}

static gboolean take_caps(LfRtpGate* self, GstCaps* caps) {
  g_autoptr(GstCaps) own = gst_caps_copy(caps);
  GstStructure* structure = gst_caps_get_structure(own, 0);
  gst_structure_set_name(structure, "application/x-rtp");
  const gchar* encoding = gst_structure_get_string(structure, "encoding-name");
  delete std::exchange(self->opener, nullptr);
  if (self->keys) self->opener = new SrtpDecryptor(self->keys->keys(), encoding ? encoding : "", !self->copies);
  return gst_pad_push_event(self->src, gst_event_new_caps(own));
}

static gboolean lf_rtp_gate_event(GstPad* pad, GstObject* parent, GstEvent* event) {
  if (GST_EVENT_TYPE(event) != GST_EVENT_CAPS) return gst_pad_event_default(pad, parent, event);
  GstCaps* caps = nullptr;
  gst_event_parse_caps(event, &caps);
  const gboolean done = take_caps(LF_RTP_GATE(parent), caps);
  gst_event_unref(event);
  return done;
}

// Loads the key and looks up the peers. Returns false after posting an error.
static bool prepare(LfRtpGate* self) {
  lf::ObjectLock lock(self);
  const std::string path = self->settings->key_file, peers = self->settings->peers;
  self->copies = self->settings->copies;
  std::fill_n(self->counts, kNumPacketResults, 0);
  self->streams = 0;
  lock.unlock();
  const char* what = "key-file";
  try {
    if (!path.empty()) {
      self->keys = new lf::rtp::KeyFile(path);
      SrtpDecryptor(self->keys->keys(), "", false);  // throws if srtpdec is missing
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
  delete std::exchange(self->keys, nullptr);
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
  for (PacketResult fate = 0; fate < kNumPacketResults; fate++)
    gst_structure_set(stats, kResultNames[fate], G_TYPE_UINT64, self->counts[fate], nullptr);
  return stats;
}

static void lf_rtp_gate_finalize(GObject* object) {
  LfRtpGate* self = LF_RTP_GATE(object);
  forget(self);
  delete self->settings;
  G_OBJECT_CLASS(lf_rtp_gate_parent_class)->finalize(object);
}

static void lf_rtp_gate_class_init(LfRtpGateClass* klass) {
  GObjectClass* object_class = G_OBJECT_CLASS(klass);
  object_class->finalize = lf_rtp_gate_finalize;
  lf::Properties<settings_of, stats_of>::install(
      object_class,
      "Packets since the start, all uint64. passed counts the packets that were accepted. Each other field counts "
      "packets that were dropped for one reason: malformed (not RTP, or too short), unsealed (not encrypted), stale "
      "(timestamp more than a minute off), replayed (received before), forged (encrypted with another key, or damaged) "
      "and unknown-senders (address not in peers). streams is the number of recent senders with the key");
  GstElementClass* element_class = GST_ELEMENT_CLASS(klass);
  element_class->change_state = lf::callback<lf_rtp_gate_change_state>;
  gst_element_class_add_static_pad_template(element_class, &sink_template);
  gst_element_class_add_static_pad_template(element_class, &src_template);
  gst_element_class_set_static_metadata(
      element_class, "Light field RTP gate", "Filter/Network/SRTP",
      "Forwards only RTP packets from senders with the shared key or an allowed address", "gst-lightfield");
}

static void lf_rtp_gate_init(LfRtpGate* self) {
  self->settings = new Settings;
  self->sink = gst_pad_new_from_static_template(&sink_template, "sink");
  gst_pad_set_chain_function(self->sink, lf::callback<lf_rtp_gate_chain>);
  gst_pad_set_event_function(self->sink, lf::callback<lf_rtp_gate_event>);
  gst_element_add_pad(GST_ELEMENT(self), self->sink);
  self->src = gst_pad_new_from_static_template(&src_template, "src");
  gst_element_add_pad(GST_ELEMENT(self), self->src);
}
