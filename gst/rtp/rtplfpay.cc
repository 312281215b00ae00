// SPDX-License-Identifier: LGPL-2.1-or-later
/**
 * SECTION:element-rtplfpay
 * @title: rtplfpay
 * @short_description: puts light field requests or answers into RTP packets
 *
 * rtplfpay splits requests or answers into RTP packets, to send them to another host. The receiver is #rtplfdepay.
 *
 * Packets are never larger than #GstRTPBasePayload:mtu. This limit does not include header extensions of applications
 * and the SRTP tag. An answer is split at the borders of its fragments (parts of the view), so a lost packet costs only
 * the fragments that it contains. Each packet with a request also contains the two previous requests, so one or two
 * lost packets do no harm.
 *
 * All packets of an answer are ready at the same time, and together they may exceed the socket buffer of the receiver.
 * The element therefore spreads them over time, at the rate #rtplfpay:max-bitrate, by default one gigabit per second.
 * Set this property below the capacity of the link. Receivers should request a large buffer (`udpsrc
 * buffer-size=4000000`, limited by the sysctl `net.core.rmem_max`). Put a `queue` before the element, so that the node
 * can render its next answer while this element sends.
 *
 * The property `max-bitrate` of `udpsink` cannot replace this property. It counts from the timestamp of an answer, but
 * an answer is usually sent later. It also has no effect with `sync=false`.
 *
 * A node (an element that owns cameras and answers requests) with `codec=auto` compresses its answers if they pass this
 * element. The element also provides a clock that starts at the time of day and never jumps, even if the system clock
 * is set. Hosts need such a clock, because they exchange capture times as time of day.
 *
 * ## Answers of a node
 * |[
 * gst-launch-1.0 udpsrc port=5000 \
 *   caps="application/x-rtp,media=application,clock-rate=90000,encoding-name=X-LIGHTFIELD-REQUEST" \
 *   ! rtplfdepay ! n.request  lfcameranode name=n rig=rig.json is-live=true ! queue ! rtplfpay max-bitrate=400000000 \
 *   ! udpsink host=COMPOSITOR port=5001 sync=false
 * ]|
 */
#include "rtp/rtplfpay.h"

#include <gst/rtp/gstrtpbuffer.h>

#include "common/custom_events.h"
#include "common/gst_pointers.h"
#include "common/gst_wire.h"
#include "common/properties.h"
#include "common/wall_clock.h"
#include "rtp/packetizer.h"

GST_DEBUG_CATEGORY_STATIC(lf_rtp_pay_debug);
#define GST_CAT_DEFAULT lf_rtp_pay_debug

namespace {

struct Settings {
  guint64 max_bitrate = 1'000'000'000;  // capacity of a switch port, where the answers of several nodes meet

  static lf::PropertyTable<Settings>& properties() {
    static lf::PropertyTable<Settings> table = {lf::property<&Settings::max_bitrate>(
        lf::kWhilePlaying, "max-bitrate", "Maximum bitrate",
        "Maximum sending rate for the packets of an answer, in bits per second. Set it below the capacity of the "
        "slowest link to the receiver. Otherwise this link loses packets when several nodes send at the same time (0: "
        "no limit)",
        guint64{0}, G_MAXUINT64)};
    return table;
  }
};

}  // namespace

static constexpr guint kPacketsAtOnce = 8;

struct _LfRtpPay {
  GstRTPBasePayload parent;
  GstClock* day_clock;  // see lf_rtp_pay_provide_clock()

  // Streaming thread:
  lf::rtp::Packetizer* packetizer;
  lf::rtp::Pacer* pacer;

  // Guarded by the object lock:
  Settings settings;
  gboolean flushing;
  GstClockID wait;
  lf::rtp::Packetizer::Stats stats;
  guint64 packets, bytes, dropped;
};

static GstStaticPadTemplate sink_template =
    GST_STATIC_PAD_TEMPLATE("sink", GST_PAD_SINK, GST_PAD_ALWAYS, GST_STATIC_CAPS(LF_REQUEST_CAPS "; " LF_ANSWER_CAPS));
static GstStaticPadTemplate src_template = GST_STATIC_PAD_TEMPLATE(
    "src", GST_PAD_SRC, GST_PAD_ALWAYS, GST_STATIC_CAPS(LF_RTP_CAPS ", payload = (int) [ 0, 127 ]"));

G_DEFINE_TYPE(LfRtpPay, lf_rtp_pay, GST_TYPE_RTP_BASE_PAYLOAD)
GST_ELEMENT_REGISTER_DEFINE(rtplfpay, "rtplfpay", GST_RANK_SECONDARY, LF_TYPE_RTP_PAY)

static Settings& settings_of(LfRtpPay* self) { return self->settings; }

static GstStructure* stats_of(LfRtpPay* self) {
  GstStructure* stats = lf::base_stats(G_OBJECT(self), lf_rtp_pay_parent_class);
  const lf::ObjectLock lock(self);
  gst_structure_set(stats, "units", G_TYPE_UINT64, self->stats.units, "packets", G_TYPE_UINT64, self->packets, "parts",
                    G_TYPE_UINT64, self->stats.parts, "chunks", G_TYPE_UINT64, self->stats.chunks, "tiles",
                    G_TYPE_UINT64, self->stats.tiles, "bytes", G_TYPE_UINT64, self->bytes, "dropped", G_TYPE_UINT64,
                    self->dropped, nullptr);
  return stats;
}

using Properties = lf::Properties<settings_of, stats_of>;

static gboolean lf_rtp_pay_set_caps(GstRTPBasePayload* base, GstCaps* caps) {
  LfRtpPay* self = LF_RTP_PAY(base);
  const GstStructure* structure = gst_caps_get_structure(caps, 0);
  const lf::wire::UnitKind kind = lf::kind_of_units(structure);
  if (!self->packetizer || self->packetizer->kind() != kind) {
    delete self->packetizer;
    self->packetizer = new lf::rtp::Packetizer(kind);
  }
  const bool request = kind == lf::wire::UnitKind::kRequest;
  gst_rtp_base_payload_set_options(base, "application", TRUE,
                                   request ? LF_RTP_REQUEST_ENCODING : LF_RTP_ANSWER_ENCODING, lf::rtp::kClockRate);
  gint numerator = 0, denominator = 1;
  if (!request || !gst_structure_get_fraction(structure, "framerate", &numerator, &denominator) || numerator == 0)
    return gst_rtp_base_payload_set_outcaps(base, nullptr);
  g_autofree gchar* rate = g_strdup_printf("%d/%d", numerator, denominator);  // a string, as in SDP
  return gst_rtp_base_payload_set_outcaps(base, "framerate", G_TYPE_STRING, rate, nullptr);
}

// Waits until the next packets may be sent. Returns false if the wait was interrupted.
static bool lf_rtp_pay_wait(LfRtpPay* self, guint64 bytes, guint64 max_bitrate) {
  g_autoptr(GstClock) clock = gst_element_get_clock(GST_ELEMENT(self));
  if (!clock) return true;
  const GstClockTime now = gst_clock_get_time(clock), time = self->pacer->next(now);
  self->pacer->sent(time, bytes, max_bitrate);
  if (time <= now) return true;
  lf::ObjectLock lock(self);
  if (self->flushing) return false;
  const GstClockID id = self->wait = gst_clock_new_single_shot_id(clock, time);
  lock.unlock();
  const bool ok = gst_clock_id_wait(id, nullptr) != GST_CLOCK_UNSCHEDULED;
  lf::ObjectLock again(self);
  self->wait = nullptr;
  again.unlock();
  gst_clock_id_unref(id);
  return ok;
}

static void lf_rtp_pay_set_flushing(LfRtpPay* self, gboolean flushing) {
  const lf::ObjectLock lock(self);
  self->flushing = flushing;
  if (flushing && self->wait) gst_clock_id_unschedule(self->wait);
}

static GstFlowReturn lf_rtp_pay_push(LfRtpPay* self, GstBufferList* packets, guint64 max_bitrate) {
  const gsize bytes = gst_buffer_list_calculate_size(packets);
  const guint count = gst_buffer_list_length(packets);
  if (max_bitrate > 0 && !lf_rtp_pay_wait(self, bytes, max_bitrate)) {
    gst_buffer_list_unref(packets);
    return GST_FLOW_FLUSHING;
  }
  GST_OBJECT_LOCK(self);
  self->packets += count;
  self->bytes += bytes;
  GST_OBJECT_UNLOCK(self);
  return gst_rtp_base_payload_push_list(GST_RTP_BASE_PAYLOAD(self), packets);
}

static GstBuffer* lf_rtp_pay_packet(LfRtpPay* self, const lf::rtp::Payload& payload, GstBuffer* unit) {
  GstBuffer* packet =
      gst_rtp_base_payload_allocate_output_buffer(GST_RTP_BASE_PAYLOAD(self), static_cast<guint>(payload.size()), 0, 0);
  GstRTPBuffer rtp = GST_RTP_BUFFER_INIT;
  gst_rtp_buffer_map(packet, GST_MAP_WRITE, &rtp);
  payload.copy_to(static_cast<uint8_t*>(gst_rtp_buffer_get_payload(&rtp)));
  gst_rtp_buffer_set_marker(&rtp, payload.last);
  gst_rtp_buffer_unmap(&rtp);
  if (payload.last) GST_BUFFER_FLAG_SET(packet, GST_BUFFER_FLAG_MARKER);
  gst_buffer_copy_into(packet, unit, GST_BUFFER_COPY_TIMESTAMPS, 0, -1);
  // without this, the base class would derive RTP time from the offset
  GST_BUFFER_OFFSET(packet) = GST_BUFFER_OFFSET_NONE;
  return packet;
}

static GstFlowReturn lf_rtp_pay_unit(LfRtpPay* self, GstBuffer* buffer) {
  GstRTPBasePayload* base = GST_RTP_BASE_PAYLOAD(self);
  const guint sources = gst_rtp_base_payload_get_source_count(base, buffer);
  const guint max_payload = gst_rtp_buffer_calc_payload_len(GST_RTP_BASE_PAYLOAD_MTU(base), 0, sources);
  if (GST_RTP_BASE_PAYLOAD_MTU(base) < lf::rtp::kMinPayloadBytes || max_payload < lf::rtp::kMinPayloadBytes) {
    GST_ELEMENT_ERROR(self, LIBRARY, SETTINGS,
                      ("The MTU of %u bytes is too small: a packet has no room for data after its header. Increase the "
                       "property mtu; 1400 is usual.",
                       GST_RTP_BASE_PAYLOAD_MTU(base)),
                      ("set mtu to %u or more",
                       gst_rtp_buffer_calc_packet_len(lf::rtp::kMinPayloadBytes, 0, static_cast<guint8>(sources))));
    return GST_FLOW_ERROR;
  }
  const guint64 max_bitrate = Properties::now(self).max_bitrate;
  GstFlowReturn flow = GST_FLOW_OK;
  GstBufferList* packets = gst_buffer_list_new();
  const auto emit = [&](const lf::rtp::Payload& payload) {
    if (flow != GST_FLOW_OK) return;
    gst_buffer_list_add(packets, lf_rtp_pay_packet(self, payload, buffer));
    if (max_bitrate == 0 || gst_buffer_list_length(packets) < kPacketsAtOnce) return;
    flow = lf_rtp_pay_push(self, packets, max_bitrate);
    packets = gst_buffer_list_new();
  };
  std::string reason;
  const bool taken = self->packetizer->packetize(lf::MappedBuffer(buffer).bytes(), max_payload, emit, &reason);
  if (!taken) GST_WARNING_OBJECT(self, "dropped an invalid unit: %s", reason.c_str());
  GST_OBJECT_LOCK(self);
  self->stats = self->packetizer->stats();
  if (!taken) self->dropped++;
  GST_OBJECT_UNLOCK(self);
  if (flow == GST_FLOW_OK && gst_buffer_list_length(packets) > 0)
    flow = lf_rtp_pay_push(self, packets, max_bitrate);
  else
    gst_buffer_list_unref(packets);
  return flow;
}

static GstFlowReturn lf_rtp_pay_handle_buffer(GstRTPBasePayload* base, GstBuffer* buffer) {
  return lf::guard_buffer(base, [=] {
    const lf::BufferPtr owned(buffer);
    return lf_rtp_pay_unit(LF_RTP_PAY(base), buffer);
  });
}

static void lf_rtp_pay_reset(LfRtpPay* self) {
  if (self->packetizer) self->packetizer->clear();
  self->pacer->clear();
}

static gboolean lf_rtp_pay_sink_event(GstRTPBasePayload* base, GstEvent* event) {
  LfRtpPay* self = LF_RTP_PAY(base);
  const GstEventType type = GST_EVENT_TYPE(event);
  if (type == GST_EVENT_FLUSH_START) lf_rtp_pay_set_flushing(self, TRUE);
  const gboolean ok = GST_RTP_BASE_PAYLOAD_CLASS(lf_rtp_pay_parent_class)->sink_event(base, event);
  if (type == GST_EVENT_FLUSH_STOP) {
    lf_rtp_pay_reset(self);
    lf_rtp_pay_set_flushing(self, FALSE);
  }
  return ok;
}

static gboolean lf_rtp_pay_query(GstRTPBasePayload* base, GstPad* pad, GstQuery* query) {
  if (lf::is_in_process_query(query)) return FALSE;
  return GST_RTP_BASE_PAYLOAD_CLASS(lf_rtp_pay_parent_class)->query(base, pad, query);
}

static GstStateChangeReturn lf_rtp_pay_change_state(GstElement* element, GstStateChange transition) {
  LfRtpPay* self = LF_RTP_PAY(element);
  if (transition == GST_STATE_CHANGE_READY_TO_PAUSED) {
    lf_rtp_pay_set_flushing(self, FALSE);
    GST_OBJECT_LOCK(self);
    self->stats = {};
    self->packets = self->bytes = self->dropped = 0;
    GST_OBJECT_UNLOCK(self);
  } else if (transition == GST_STATE_CHANGE_PAUSED_TO_READY) {
    lf_rtp_pay_set_flushing(self, TRUE);
  }
  const GstStateChangeReturn result = GST_ELEMENT_CLASS(lf_rtp_pay_parent_class)->change_state(element, transition);
  if (transition == GST_STATE_CHANGE_PAUSED_TO_READY) {
    delete self->packetizer;
    self->packetizer = nullptr;
    self->pacer->clear();
  }
  return result;
}

static GstClock* lf_rtp_pay_provide_clock(GstElement* element) {
  return GST_CLOCK(gst_object_ref(LF_RTP_PAY(element)->day_clock));
}

// Makes properties of GstRTPBasePayload read-only that have no effect here. They are for streams that can be split at
// any time.
static constexpr guint kFirstTimeLimit = 100;

static void lf_rtp_pay_get_property(GObject* object, guint id, GValue* value, GParamSpec* pspec) {
  if (id < kFirstTimeLimit) return Properties::get(object, id, value, pspec);
  g_param_value_set_default(pspec, value);
}

static void lf_rtp_pay_install_time_limits(GObjectClass* klass) {
  struct TimeLimit {
    const char *name, *nick;
    gint64 value;
  };
  constexpr TimeLimit kLimits[] = {{"min-ptime", "Min packet time", 0},
                                   {"max-ptime", "Max packet time", -1},
                                   {"ptime-multiple", "Packet time multiple", 0}};
  guint id = kFirstTimeLimit;
  for (const TimeLimit& limit : kLimits)
    g_object_class_install_property(
        klass, id++,
        g_param_spec_int64(limit.name, limit.nick, "Not supported: units are split by mtu instead of time", -1,
                           G_MAXINT64, limit.value, GParamFlags(G_PARAM_READABLE | G_PARAM_STATIC_STRINGS)));
}

static void lf_rtp_pay_finalize(GObject* object) {
  LfRtpPay* self = LF_RTP_PAY(object);
  delete self->packetizer;
  delete self->pacer;
  gst_object_unref(self->day_clock);
  G_OBJECT_CLASS(lf_rtp_pay_parent_class)->finalize(object);
}

static void lf_rtp_pay_class_init(LfRtpPayClass* klass) {
  GST_DEBUG_CATEGORY_INIT(lf_rtp_pay_debug, "rtplfpay", 0, "light field RTP payloader");
  GObjectClass* object_class = G_OBJECT_CLASS(klass);
  object_class->finalize = lf_rtp_pay_finalize;
  Properties::install(
      object_class,
      "Statistics of GstRTPBasePayload, and counters since the start (all uint64). units counts the messages (requests "
      "or parts of answers) that were received, and dropped counts the invalid messages. packets and bytes count RTP "
      "packets and their bytes. parts counts packets with whole units, and chunks counts packets with a part of a "
      "unit. tiles counts parts of raw fragments, which can be displayed without the rest");
  object_class->get_property = lf::callback<lf_rtp_pay_get_property>;
  lf_rtp_pay_install_time_limits(object_class);

  GstElementClass* element_class = GST_ELEMENT_CLASS(klass);
  element_class->change_state = lf::callback<lf_rtp_pay_change_state>;
  element_class->provide_clock = lf::callback<lf_rtp_pay_provide_clock>;
  gst_element_class_add_static_pad_template(element_class, &sink_template);
  gst_element_class_add_static_pad_template(element_class, &src_template);
  gst_element_class_set_static_metadata(element_class, "Light field RTP payloader", "Codec/Payloader/Network/RTP",
                                        "Splits light field requests or answers into RTP packets",
                                        "gst-lightfield developers");

  GstRTPBasePayloadClass* base_class = GST_RTP_BASE_PAYLOAD_CLASS(klass);
  base_class->set_caps = lf::callback<lf_rtp_pay_set_caps>;
  base_class->handle_buffer = lf_rtp_pay_handle_buffer;
  base_class->sink_event = lf::callback<lf_rtp_pay_sink_event>;
  base_class->query = lf::callback<lf_rtp_pay_query>;
}

static void lf_rtp_pay_init(LfRtpPay* self) {
  self->settings = {};
  self->pacer = new lf::rtp::Pacer;
  self->day_clock = lf::new_wall_clock();
  GST_OBJECT_FLAG_SET(self, GST_ELEMENT_FLAG_PROVIDE_CLOCK);
  lf::accept_unit_caps(GST_RTP_BASE_PAYLOAD_SINKPAD(self));
}
