// SPDX-License-Identifier: LGPL-2.1-or-later
/**
 * SECTION:element-rtplfdepay
 * @title: rtplfdepay
 * @short_description: extracts light field requests or answers from RTP packets
 *
 * rtplfdepay receives the packets of #rtplfpay. It forwards each part of an answer as soon as this part is complete,
 * and #lfcompositor counts the parts to detect complete answers. Packets may be lost, duplicated or reordered, and
 * several senders may share a port. The element therefore needs no `rtpjitterbuffer`, which would add delay, but it
 * also works behind one, for example in `rtpbin`. A request that arrives several times is forwarded only once, and
 * requests stay in order.
 *
 * Invalid data, whether damaged or forged, is dropped and counted in #rtplfdepay:stats. #rtplfdepay:max-size-bytes
 * limits the memory for messages that still lack packets.
 *
 * ## Record the answers of a node
 * |[
 * gst-launch-1.0 udpsrc port=5001 buffer-size=4000000 \
 *   caps="application/x-rtp,media=application,clock-rate=90000,encoding-name=X-LIGHTFIELD-ANSWER" \
 *   ! rtplfdepay ! filesink location=answers.lfa
 * ]|
 */
#include <gst/gst.h>
#include <gst/rtp/gstrtpbasedepayload.h>

#include <gst/rtp/gstrtpbuffer.h>

#include "common/custom_events.h"
#include "common/gst_wire.h"
#include "common/properties.h"
#include "common/request_guard.h"
#include "rtp/depacketizer.h"
#include "rtp/rtplfpay.h"

GST_DEBUG_CATEGORY_STATIC(lf_rtp_depay_debug);
#define GST_CAT_DEFAULT lf_rtp_depay_debug

namespace {

struct Settings {
  guint64 max_size_bytes = lf::rtp::Reassembly::Limits().bytes;

  static lf::PropertyTable<Settings>& properties() {
    static lf::PropertyTable<Settings> table = {lf::property<&Settings::max_size_bytes>(
        lf::kWhilePlaying, "max-size-bytes", "Maximum size in bytes",
        "Maximum memory for messages with missing packets, in bytes. A message is a request or a part of an answer, "
        "and usually consists of several packets. If more memory is needed, the element drops the oldest incomplete "
        "messages. Increase the value if incomplete-units in `stats` grows although no packets are lost",
        guint64{1 << 16}, guint64{lf::wire::kMaxAnswerBytes})};
    return table;
  }
};

}  // namespace

#define LF_TYPE_RTP_DEPAY (lf_rtp_depay_get_type())
G_DECLARE_FINAL_TYPE(LfRtpDepay, lf_rtp_depay, LF, RTP_DEPAY, GstRTPBaseDepayload)

struct _LfRtpDepay {
  GstRTPBaseDepayload parent;

  // Streaming thread:
  lf::rtp::Depacketizer* depacketizer;
  bool warned_foreign;

  lf::RequestGuard* guard;

  // Guarded by the object lock:
  Settings settings;
  lf::rtp::Depacketizer::Stats stats;
  guint64 bad_rtp;
};

static GstStaticPadTemplate sink_template =
    GST_STATIC_PAD_TEMPLATE("sink", GST_PAD_SINK, GST_PAD_ALWAYS, GST_STATIC_CAPS(LF_RTP_CAPS));
static GstStaticPadTemplate src_template =
    GST_STATIC_PAD_TEMPLATE("src", GST_PAD_SRC, GST_PAD_ALWAYS,
                            GST_STATIC_CAPS(LF_REQUEST_CAPS ", framerate = (fraction) [ 0/1, max ]; " LF_ANSWER_CAPS));

G_DEFINE_TYPE(LfRtpDepay, lf_rtp_depay, GST_TYPE_RTP_BASE_DEPAYLOAD)
GST_ELEMENT_REGISTER_DEFINE(rtplfdepay, "rtplfdepay", GST_RANK_SECONDARY, LF_TYPE_RTP_DEPAY)

// Returns true if a request is within the limits, or if an answer is not larger than the limits allow. Views are
// distinguished by id only, so that forged sender ids do not gain additional views.
static bool lf_rtp_depay_admits(LfRtpDepay* self, lf::wire::UnitKind kind, std::span<const uint8_t> unit) {
  if (kind == lf::wire::UnitKind::kRequest) return self->guard->admits(GST_ELEMENT(self), unit, 0, true);
  const std::optional<std::pair<int, int>> size = lf::wire::peek_answer_size(unit);
  return !size || self->guard->admits_answer(GST_ELEMENT(self), size->first, size->second);
}

static gboolean lf_rtp_depay_set_caps(GstRTPBaseDepayload* base, GstCaps* caps) {
  LfRtpDepay* self = LF_RTP_DEPAY(base);
  const GstStructure* structure = gst_caps_get_structure(caps, 0);
  base->clock_rate = lf::rtp::kClockRate;
  const lf::wire::UnitKind kind = lf::kind_of_rtp(structure);
  if (!self->depacketizer || self->depacketizer->kind() != kind) {
    delete self->depacketizer;
    self->depacketizer = new lf::rtp::Depacketizer(kind);
    self->depacketizer->set_filter(
        [self, kind](std::span<const uint8_t> unit) { return lf_rtp_depay_admits(self, kind, unit); });
  }

  const bool is_answer = kind == lf::wire::UnitKind::kAnswer;
  g_autoptr(GstCaps) out = lf::unit_caps(is_answer ? LF_ANSWER_MEDIA_TYPE : LF_REQUEST_MEDIA_TYPE);
  if (!is_answer) {
    g_auto(GValue) rate = G_VALUE_INIT;
    g_value_init(&rate, GST_TYPE_FRACTION);
    const gchar* text = gst_structure_get_string(structure, "framerate");
    if (!text || !gst_value_deserialize(&rate, text)) gst_value_set_fraction(&rate, 0, 1);
    gst_caps_set_value(out, "framerate", &rate);
  }
  return gst_pad_set_caps(GST_RTP_BASE_DEPAYLOAD_SRCPAD(base), out);
}

static bool is_rtp(LfRtpDepay* self, GstBuffer* buffer) {
  GstRTPBuffer rtp = GST_RTP_BUFFER_INIT;
  if (gst_rtp_buffer_map(buffer, GST_MAP_READ, &rtp)) {
    gst_rtp_buffer_unmap(&rtp);
    return true;
  }
  GST_DEBUG_OBJECT(self, "dropped a packet that is not RTP; check which program sends to this port");
  const lf::ObjectLock lock(self);
  self->bad_rtp++;
  return false;
}

// Drops packets that are not RTP here, because the base class would post a warning for each.
static GstPadProbeReturn lf_rtp_depay_filter(GstPad*, GstPadProbeInfo* info, gpointer data) {
  LfRtpDepay* self = LF_RTP_DEPAY(data);
  if (info->type & GST_PAD_PROBE_TYPE_BUFFER)
    return is_rtp(self, GST_PAD_PROBE_INFO_BUFFER(info)) ? GST_PAD_PROBE_OK : GST_PAD_PROBE_DROP;
  GstBufferList* list = gst_buffer_list_make_writable(GST_PAD_PROBE_INFO_BUFFER_LIST(info));
  for (guint i = gst_buffer_list_length(list); i-- > 0;)
    if (!is_rtp(self, gst_buffer_list_get(list, i))) gst_buffer_list_remove(list, i, 1);
  info->data = list;
  return GST_PAD_PROBE_OK;
}

// Drops the query: the compositor downstream is reached over the network, so it is not in the process of the node.
static GstPadProbeReturn lf_rtp_depay_query(GstPad*, GstPadProbeInfo* info, gpointer) {
  return lf::is_in_process_query(GST_PAD_PROBE_INFO_QUERY(info)) ? GST_PAD_PROBE_DROP : GST_PAD_PROBE_OK;
}

// Warns if all packets are damaged, because encrypted packets look like damage if the receiver has no key.
static void warn_of_foreign(LfRtpDepay* self, const lf::rtp::Depacketizer::Stats& stats) {
  constexpr uint64_t kMany = 20;
  const uint64_t bad = stats.bad_packets + stats.bad_chunks + stats.bad_units;
  if (self->warned_foreign || stats.units > 0 || bad < kMany) return;
  self->warned_foreign = true;
  GST_ELEMENT_WARNING(self, RESOURCE, SETTINGS,
                      ("All received packets are unreadable: is key-file set on the sender only? Use the same key-file "
                       "on both hosts, or none."),
                      ("%" G_GUINT64_FORMAT " packets", stats.packets));
}

static lf::rtp::Depacketizer::Stats publish_stats(LfRtpDepay* self) {
  const lf::ObjectLock lock(self);
  return self->stats = self->depacketizer->stats();
}

static void lf_rtp_depay_packet(LfRtpDepay* self, GstRTPBuffer* rtp) {
  GstRTPBaseDepayload* base = GST_RTP_BASE_DEPAYLOAD(self);
  lf::ObjectLock lock(self);
  self->depacketizer->set_limits({.bytes = self->settings.max_size_bytes});
  lock.unlock();
  const auto* payload = static_cast<const uint8_t*>(gst_rtp_buffer_get_payload(rtp));
  const lf::rtp::Packet packet{gst_rtp_buffer_get_ssrc(rtp),
                               gst_rtp_buffer_get_seq(rtp),
                               gst_rtp_buffer_get_timestamp(rtp),
                               {payload, gst_rtp_buffer_get_payload_len(rtp)}};
  GstFlowReturn flow = GST_FLOW_OK;
  self->depacketizer->push(packet, [&](std::span<const uint8_t> bytes, lf::ByteBuffer* own) {
    GstBuffer* unit = own ? lf::wrap_bytes(std::move(*own))
                          : gst_rtp_buffer_get_payload_subbuffer(rtp, static_cast<guint>(bytes.data() - payload),
                                                                 static_cast<guint>(bytes.size()));
    GST_BUFFER_PTS(unit) = GST_BUFFER_PTS(rtp->buffer);
    if (flow == GST_FLOW_OK)
      flow = gst_rtp_base_depayload_push(base, unit);
    else
      gst_buffer_unref(unit);
  });
  warn_of_foreign(self, publish_stats(self));
}

static GstBuffer* lf_rtp_depay_process(GstRTPBaseDepayload* base, GstRTPBuffer* rtp) {
  lf::guard_buffer(base, [=] { return lf_rtp_depay_packet(LF_RTP_DEPAY(base), rtp), GST_FLOW_OK; });
  return nullptr;
}

// Ignores the gaps that the base class reports, because missing packets are detected by counting.
static gboolean lf_rtp_depay_packet_lost(GstRTPBaseDepayload*, GstEvent*) { return TRUE; }

static gboolean lf_rtp_depay_handle_event(GstRTPBaseDepayload* base, GstEvent* event) {
  LfRtpDepay* self = LF_RTP_DEPAY(base);
  const GstEventType type = GST_EVENT_TYPE(event);
  if (self->depacketizer && (type == GST_EVENT_FLUSH_STOP || type == GST_EVENT_EOS)) {
    self->depacketizer->clear();
    publish_stats(self);
  }
  return GST_RTP_BASE_DEPAYLOAD_CLASS(lf_rtp_depay_parent_class)->handle_event(base, event);
}

static GstStateChangeReturn lf_rtp_depay_change_state(GstElement* element, GstStateChange transition) {
  LfRtpDepay* self = LF_RTP_DEPAY(element);
  if (transition == GST_STATE_CHANGE_READY_TO_PAUSED) {
    GST_OBJECT_LOCK(self);
    self->stats = {};
    self->bad_rtp = 0;
    GST_OBJECT_UNLOCK(self);
    self->guard->start(element);
    self->warned_foreign = false;
  }
  const GstStateChangeReturn result = GST_ELEMENT_CLASS(lf_rtp_depay_parent_class)->change_state(element, transition);
  if (transition == GST_STATE_CHANGE_PAUSED_TO_READY) {
    delete self->depacketizer;
    self->depacketizer = nullptr;
  }
  return result;
}

static Settings& settings_of(LfRtpDepay* self) { return self->settings; }

static GstStructure* stats_of(LfRtpDepay* self) {
  GstStructure* stats = lf::base_stats(G_OBJECT(self), lf_rtp_depay_parent_class);
  lf::ObjectLock lock(self);
  const lf::rtp::Depacketizer::Stats s = self->stats;
  gst_structure_set(stats, "packets", G_TYPE_UINT64, s.packets, "bytes", G_TYPE_UINT64, s.bytes, "units", G_TYPE_UINT64,
                    s.units, "chunks", G_TYPE_UINT64, s.chunks, "repeated", G_TYPE_UINT64, s.repeated, "lost",
                    G_TYPE_UINT64, s.lost, "duplicates", G_TYPE_UINT64, s.duplicates, "bad-rtp", G_TYPE_UINT64,
                    self->bad_rtp, "bad-packets", G_TYPE_UINT64, s.bad_packets, "bad-chunks", G_TYPE_UINT64,
                    s.bad_chunks, "bad-units", G_TYPE_UINT64, s.bad_units, "incomplete-units", G_TYPE_UINT64,
                    s.incomplete_units, "superseded", G_TYPE_UINT64, s.superseded, nullptr);
  lock.unlock();
  self->guard->add_stats(stats);
  return stats;
}

static lf::RequestGuard& guard_of(LfRtpDepay* self) { return *self->guard; }

static void lf_rtp_depay_finalize(GObject* object) {
  delete LF_RTP_DEPAY(object)->depacketizer;
  delete LF_RTP_DEPAY(object)->guard;
  G_OBJECT_CLASS(lf_rtp_depay_parent_class)->finalize(object);
}

static void lf_rtp_depay_class_init(LfRtpDepayClass* klass) {
  GST_DEBUG_CATEGORY_INIT(lf_rtp_depay_debug, "rtplfdepay", 0, "light field RTP depayloader");
  GObjectClass* object_class = G_OBJECT_CLASS(klass);
  object_class->finalize = lf_rtp_depay_finalize;
  lf::Properties<settings_of, stats_of, guard_of>::install(
      object_class,
      "Statistics of GstRTPBaseDepayload, and counters since the start (all uint64). A unit is one complete message, "
      "and a chunk is a packet with a part of a unit. These fields count received data: packets, bytes (of payloads), "
      "units (forwarded), chunks, repeated (requests that had arrived before) and lost (packets, according to gaps in "
      "sequence numbers). These fields count dropped data: duplicates (packets), bad-rtp (not RTP), bad-packets "
      "(unknown payload), bad-chunks (inconsistent, or of a unit that is too large), bad-units (invalid), "
      "incomplete-units (missing chunks), superseded (requests with more than two newer requests in the same packet) "
      "and refused (requests beyond a limit). Refused requests are also counted by limit: refused-pixels, -aperture, "
      "-hypotheses, -rate, -views, -lens");

  GstElementClass* element_class = GST_ELEMENT_CLASS(klass);
  element_class->change_state = lf::callback<lf_rtp_depay_change_state>;
  gst_element_class_add_static_pad_template(element_class, &sink_template);
  gst_element_class_add_static_pad_template(element_class, &src_template);
  gst_element_class_set_static_metadata(element_class, "Light field RTP depayloader", "Codec/Depayloader/Network/RTP",
                                        "Extracts light field requests or answers from RTP packets",
                                        "gst-lightfield developers");

  GstRTPBaseDepayloadClass* base_class = GST_RTP_BASE_DEPAYLOAD_CLASS(klass);
  base_class->set_caps = lf::callback<lf_rtp_depay_set_caps>;
  base_class->process_rtp_packet = lf_rtp_depay_process;
  base_class->packet_lost = lf::callback<lf_rtp_depay_packet_lost>;
  base_class->handle_event = lf::callback<lf_rtp_depay_handle_event>;
}

static void lf_rtp_depay_init(LfRtpDepay* self) {
  self->settings = {};
  self->guard = new lf::RequestGuard;
  // max-reorder would make the base class drop reordered packets; Depacketizer detects duplicates instead. If
  // auto-header-extension is set, GStreamer 1.22.0 hangs at a malformed header extension.
  g_object_set(self, "max-reorder", 0, "auto-header-extension", FALSE, nullptr);
  GstPad* sink = GST_RTP_BASE_DEPAYLOAD_SINKPAD(self);
  gst_pad_add_probe(sink, GstPadProbeType(GST_PAD_PROBE_TYPE_BUFFER | GST_PAD_PROBE_TYPE_BUFFER_LIST),
                    lf_rtp_depay_filter, self, nullptr);
  gst_pad_add_probe(sink, GST_PAD_PROBE_TYPE_QUERY_DOWNSTREAM, lf::callback<lf_rtp_depay_query>, nullptr, nullptr);
}
