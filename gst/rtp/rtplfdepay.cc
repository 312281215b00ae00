// SPDX-License-Identifier: LGPL-2.1-or-later
/**
 * SECTION:element-rtplfdepay
 * @title: rtplfdepay
 * @short_description: takes light field requests or answers out of RTP packets
 *
 * Answers come in parts, as they were sent: each is pushed at once, and #lfcompositor knows by counting when an answer
 * is whole. Packets may be lost, doubled or out of order, and several senders may share a port: no `rtpjitterbuffer` is
 * needed, and without one there is no delay. With one (in `rtpbin`) everything works as well. The repeated requests are
 * passed on once and in order.
 *
 * Whatever is damaged or forged is dropped and counted in #rtplfdepay:stats; memory is bounded by
 * #rtplfdepay:max-pending-bytes.
 *
 * ## Record the answers of a node
 * |[
 * gst-launch-1.0 udpsrc port=5001 buffer-size=4000000 \
 *   caps="application/x-rtp,media=application,clock-rate=90000,encoding-name=X-LIGHTFIELD-ANSWER" \
 *   ! rtplfdepay ! filesink location=answers.lfa
 * ]|
 */
#include "rtp/rtplfdepay.h"

#include <gst/rtp/gstrtpbuffer.h>

#include "gst_wire.h"
#include "rtp/depacketizer.h"
#include "rtp/rtp_caps.h"

GST_DEBUG_CATEGORY_STATIC(lf_rtp_depay_debug);
#define GST_CAT_DEFAULT lf_rtp_depay_debug

enum { PROP_0, PROP_MAX_PENDING_BYTES, PROP_STATS };

struct _LfRtpDepay {
  GstRTPBaseDepayload parent;

  // Streaming thread.
  GstPadChainFunction base_chain;
  lf::rtp::Depacketizer* depacketizer;  // null before caps

  // Object lock.
  guint64 max_pending_bytes;
  lf::rtp::Depacketizer::Stats stats;
  guint64 bad_rtp;
};

static constexpr guint64 kDefaultMaxPendingBytes = lf::rtp::Reassembly::Limits().bytes;

static GstStaticPadTemplate sink_template =
    GST_STATIC_PAD_TEMPLATE("sink", GST_PAD_SINK, GST_PAD_ALWAYS, GST_STATIC_CAPS(LF_RTP_CAPS));
static GstStaticPadTemplate src_template = GST_STATIC_PAD_TEMPLATE(
    "src", GST_PAD_SRC, GST_PAD_ALWAYS,
    GST_STATIC_CAPS(LF_REQUEST_MEDIA_TYPE ", framerate = (fraction) [ 0/1, max ]; " LF_ANSWER_MEDIA_TYPE));

G_DEFINE_TYPE(LfRtpDepay, lf_rtp_depay, GST_TYPE_RTP_BASE_DEPAYLOAD)
GST_ELEMENT_REGISTER_DEFINE(rtplfdepay, "rtplfdepay", GST_RANK_SECONDARY, LF_TYPE_RTP_DEPAY)

static gboolean lf_rtp_depay_set_caps(GstRTPBaseDepayload* base, GstCaps* caps) {
  LfRtpDepay* self = LF_RTP_DEPAY(base);
  const GstStructure* structure = gst_caps_get_structure(caps, 0);
  base->clock_rate = lf::rtp::kClockRate;
  const lf::wire::UnitKind kind = lf::kind_of_rtp(structure);
  if (!self->depacketizer || self->depacketizer->kind() != kind) {
    delete self->depacketizer;
    self->depacketizer = new lf::rtp::Depacketizer(kind);
  }

  GstCaps* out = nullptr;
  if (kind == lf::wire::UnitKind::kAnswer) {
    out = gst_caps_new_empty_simple(LF_ANSWER_MEDIA_TYPE);
  } else {
    GValue rate = G_VALUE_INIT;
    g_value_init(&rate, GST_TYPE_FRACTION);
    const gchar* text = gst_structure_get_string(structure, "framerate");
    if (!text || !gst_value_deserialize(&rate, text)) gst_value_set_fraction(&rate, 0, 1);
    out = gst_caps_new_empty_simple(LF_REQUEST_MEDIA_TYPE);
    gst_caps_set_value(out, "framerate", &rate);
    g_value_unset(&rate);
  }
  const gboolean ok = gst_pad_set_caps(GST_RTP_BASE_DEPAYLOAD_SRCPAD(base), out);
  gst_caps_unref(out);
  return ok;
}

// In front of the base class, which posts a warning for each packet that is no RTP.
static GstFlowReturn lf_rtp_depay_chain(GstPad* pad, GstObject* parent, GstBuffer* buffer) {
  LfRtpDepay* self = LF_RTP_DEPAY(parent);
  GstRTPBuffer rtp = GST_RTP_BUFFER_INIT;
  if (!gst_rtp_buffer_map(buffer, GST_MAP_READ, &rtp)) {
    GST_DEBUG_OBJECT(self, "dropped a packet that is no RTP");
    GST_OBJECT_LOCK(self);
    self->bad_rtp++;
    GST_OBJECT_UNLOCK(self);
    gst_buffer_unref(buffer);
    return GST_FLOW_OK;
  }
  gst_rtp_buffer_unmap(&rtp);
  return self->base_chain(pad, parent, buffer);
}

static GstFlowReturn lf_rtp_depay_chain_list(GstPad* pad, GstObject* parent, GstBufferList* list) {
  GstFlowReturn flow = GST_FLOW_OK;
  for (guint i = 0; i < gst_buffer_list_length(list) && flow == GST_FLOW_OK; i++)
    flow = lf_rtp_depay_chain(pad, parent, gst_buffer_ref(gst_buffer_list_get(list, i)));
  gst_buffer_list_unref(list);
  return flow;
}

static GstBuffer* lf_rtp_depay_process(GstRTPBaseDepayload* base, GstRTPBuffer* rtp) {
  LfRtpDepay* self = LF_RTP_DEPAY(base);
  GST_OBJECT_LOCK(self);
  self->depacketizer->set_limits({.bytes = self->max_pending_bytes});
  GST_OBJECT_UNLOCK(self);

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
  const lf::rtp::Depacketizer::Stats stats = self->depacketizer->stats();
  GST_OBJECT_LOCK(self);
  self->stats = stats;
  GST_OBJECT_UNLOCK(self);
  return nullptr;
}

// Time goes on without the gap that the base class would announce: what is missing is found by counting.
static gboolean lf_rtp_depay_packet_lost(GstRTPBaseDepayload*, GstEvent*) { return TRUE; }

static gboolean lf_rtp_depay_handle_event(GstRTPBaseDepayload* base, GstEvent* event) {
  LfRtpDepay* self = LF_RTP_DEPAY(base);
  const GstEventType type = GST_EVENT_TYPE(event);
  if (self->depacketizer && (type == GST_EVENT_FLUSH_STOP || type == GST_EVENT_EOS)) {
    self->depacketizer->clear();
    const lf::rtp::Depacketizer::Stats stats = self->depacketizer->stats();
    GST_OBJECT_LOCK(self);
    self->stats = stats;
    GST_OBJECT_UNLOCK(self);
  }
  return GST_RTP_BASE_DEPAYLOAD_CLASS(lf_rtp_depay_parent_class)->handle_event(base, event);
}

static gboolean lf_rtp_depay_sink_query(GstPad* pad, GstObject* parent, GstQuery* query) {
  if (lf::is_in_process_query(query)) return FALSE;
  return gst_pad_query_default(pad, parent, query);
}

static GstStateChangeReturn lf_rtp_depay_change_state(GstElement* element, GstStateChange transition) {
  LfRtpDepay* self = LF_RTP_DEPAY(element);
  if (transition == GST_STATE_CHANGE_READY_TO_PAUSED) {
    GST_OBJECT_LOCK(self);
    self->stats = {};
    self->bad_rtp = 0;
    GST_OBJECT_UNLOCK(self);
  }
  const GstStateChangeReturn result = GST_ELEMENT_CLASS(lf_rtp_depay_parent_class)->change_state(element, transition);
  if (transition == GST_STATE_CHANGE_PAUSED_TO_READY) {
    delete self->depacketizer;
    self->depacketizer = nullptr;
  }
  return result;
}

static void lf_rtp_depay_set_property(GObject* object, guint id, const GValue* value, GParamSpec* spec) {
  LfRtpDepay* self = LF_RTP_DEPAY(object);
  switch (id) {
    case PROP_MAX_PENDING_BYTES:
      GST_OBJECT_LOCK(self);
      self->max_pending_bytes = g_value_get_uint64(value);
      GST_OBJECT_UNLOCK(self);
      break;
    default: G_OBJECT_WARN_INVALID_PROPERTY_ID(object, id, spec);
  }
}

static void lf_rtp_depay_get_property(GObject* object, guint id, GValue* value, GParamSpec* spec) {
  LfRtpDepay* self = LF_RTP_DEPAY(object);
  switch (id) {
    case PROP_MAX_PENDING_BYTES:
      GST_OBJECT_LOCK(self);
      g_value_set_uint64(value, self->max_pending_bytes);
      GST_OBJECT_UNLOCK(self);
      break;
    case PROP_STATS: {
      GstStructure* stats = lf::base_stats(object, lf_rtp_depay_parent_class);
      GST_OBJECT_LOCK(self);
      const lf::rtp::Depacketizer::Stats s = self->stats;
      gst_structure_set(stats, "packets", G_TYPE_UINT64, s.packets, "bytes", G_TYPE_UINT64, s.bytes, "units",
                        G_TYPE_UINT64, s.units, "chunks", G_TYPE_UINT64, s.chunks, "repeated", G_TYPE_UINT64,
                        s.repeated, "lost", G_TYPE_UINT64, s.lost, "duplicates", G_TYPE_UINT64, s.duplicates, "bad-rtp",
                        G_TYPE_UINT64, self->bad_rtp, "bad-packets", G_TYPE_UINT64, s.bad_packets, "bad-chunks",
                        G_TYPE_UINT64, s.bad_chunks, "bad-units", G_TYPE_UINT64, s.bad_units, "incomplete-units",
                        G_TYPE_UINT64, s.incomplete_units, nullptr);
      GST_OBJECT_UNLOCK(self);
      g_value_take_boxed(value, stats);
      break;
    }
    default: G_OBJECT_WARN_INVALID_PROPERTY_ID(object, id, spec);
  }
}

static void lf_rtp_depay_finalize(GObject* object) {
  delete LF_RTP_DEPAY(object)->depacketizer;
  G_OBJECT_CLASS(lf_rtp_depay_parent_class)->finalize(object);
}

static void lf_rtp_depay_class_init(LfRtpDepayClass* klass) {
  GST_DEBUG_CATEGORY_INIT(lf_rtp_depay_debug, "rtplfdepay", 0, "light field RTP depayloader");
  GObjectClass* object_class = G_OBJECT_CLASS(klass);
  object_class->set_property = lf_rtp_depay_set_property;
  object_class->get_property = lf_rtp_depay_get_property;
  object_class->finalize = lf_rtp_depay_finalize;
  g_object_class_install_property(
      object_class, PROP_MAX_PENDING_BYTES,
      g_param_spec_uint64(
          "max-pending-bytes", "Maximum pending bytes",
          "Bytes of units kept at most while some of their packets are missing; larger units are dropped", 1 << 16,
          lf::wire::kMaxAnswerBytes, kDefaultMaxPendingBytes,
          static_cast<GParamFlags>(G_PARAM_READWRITE | G_PARAM_STATIC_STRINGS | GST_PARAM_MUTABLE_PLAYING)));
  g_object_class_install_property(
      object_class, PROP_STATS,
      g_param_spec_boxed(
          "stats", "Statistics",
          "Those of every RTP depayloader and, since the start (all uint64): packets (that came), bytes (of their "
          "payloads), units (passed on), chunks (packets with a piece of a unit), repeated (requests that were known "
          "already), lost (packets missing in a sender's sequence); dropped: duplicates (packets), bad-rtp (no RTP), "
          "bad-packets (no payload of ours), bad-chunks (that contradict others, or of too large a unit), bad-units "
          "(not "
          "sound), incomplete-units (given up with chunks missing)",
          GST_TYPE_STRUCTURE, static_cast<GParamFlags>(G_PARAM_READABLE | G_PARAM_STATIC_STRINGS)));

  GstElementClass* element_class = GST_ELEMENT_CLASS(klass);
  element_class->change_state = lf_rtp_depay_change_state;
  gst_element_class_add_static_pad_template(element_class, &sink_template);
  gst_element_class_add_static_pad_template(element_class, &src_template);
  gst_element_class_set_static_metadata(element_class, "Light field RTP depayloader", "Codec/Depayloader/Network/RTP",
                                        "Takes light field requests or answers out of RTP packets",
                                        "gst-lightfield developers");

  GstRTPBaseDepayloadClass* base_class = GST_RTP_BASE_DEPAYLOAD_CLASS(klass);
  base_class->set_caps = lf_rtp_depay_set_caps;
  base_class->process_rtp_packet = lf_rtp_depay_process;
  base_class->packet_lost = lf_rtp_depay_packet_lost;
  base_class->handle_event = lf_rtp_depay_handle_event;
}

static void lf_rtp_depay_init(LfRtpDepay* self) {
  self->max_pending_bytes = kDefaultMaxPendingBytes;
  // max-reorder: the base class drops what was overtaken; our own window knows duplicates. auto-header-extension:
  // GStreamer 1.22.0 never comes back from a malformed header extension.
  g_object_set(self, "max-reorder", 0, "auto-header-extension", FALSE, nullptr);
  GstPad* sink = GST_RTP_BASE_DEPAYLOAD_SINKPAD(self);
  self->base_chain = GST_PAD_CHAINFUNC(sink);
  gst_pad_set_chain_function(sink, lf_rtp_depay_chain);
  gst_pad_set_chain_list_function(sink, lf_rtp_depay_chain_list);
  gst_pad_set_query_function(sink, lf_rtp_depay_sink_query);
}
