// SPDX-License-Identifier: LGPL-2.1-or-later
#include "serve/peer.h"

#define GST_USE_UNSTABLE_API
#include <gst/webrtc/webrtc.h>

#include <algorithm>
#include <chrono>
#include <mutex>
#include <semaphore>

#include "serve/offer.h"
#include "serve/process.h"

namespace lf::serve {
namespace {

constexpr int kMaxStreams = 2;  // SCTP streams: the data channels "control" and "surface"

using Reply = std::function<void(const GstStructure*)>;

// Returns a promise for one call of webrtcbin, which takes ownership. `reply` runs on a thread of webrtcbin and
// receives null if there is no reply.
GstPromise* promise(Reply reply) {
  return gst_promise_new_with_change_func(
      [](GstPromise* promise, gpointer data) {
        const bool kept = gst_promise_wait(promise) == GST_PROMISE_RESULT_REPLIED;
        (*static_cast<Reply*>(data))(kept ? gst_promise_get_reply(promise) : nullptr);
        gst_promise_unref(promise);
      },
      new Reply(std::move(reply)), [](gpointer data) { delete static_cast<Reply*>(data); });
}

bool is_error(const GstStructure* reply) { return reply && gst_structure_has_field(reply, "error"); }

// Signal handlers hold a weak reference, because a handler may run after the peer was destroyed.
using Weak = std::weak_ptr<Peer>;

template <typename Handler>
void connect(gpointer object, const char* signal, Handler* handler, const Weak& peer) {
  g_signal_connect_data(
      object, signal, G_CALLBACK(handler), new Weak(peer),
      [](gpointer data, GClosure*) { delete static_cast<Weak*>(data); }, GConnectFlags(0));
}
std::shared_ptr<Peer> peer_of(gpointer data) { return static_cast<Weak*>(data)->lock(); }

// Processes a packet. Takes ownership of the buffer and returns an owned buffer, or null to drop the packet.
using Filter = std::function<GstBuffer*(GstBuffer*)>;

void filter(GstElement* element, const char* pad_name, Filter by) {
  g_autoptr(GstPad) pad = gst_element_get_static_pad(element, pad_name);
  const auto each = [](GstBuffer** buffer, guint, gpointer data) -> gboolean {
    *buffer = (*static_cast<Filter*>(data))(*buffer);
    return TRUE;
  };
  struct Probe {
    Filter by;
    GstBufferListFunc each;
  };
  gst_pad_add_probe(
      pad, GstPadProbeType(GST_PAD_PROBE_TYPE_BUFFER | GST_PAD_PROBE_TYPE_BUFFER_LIST),
      [](GstPad*, GstPadProbeInfo* info, gpointer data) {
        auto* probe = static_cast<Probe*>(data);
        if (info->type & GST_PAD_PROBE_TYPE_BUFFER) {
          info->data = probe->by(GST_PAD_PROBE_INFO_BUFFER(info));
          return info->data ? GST_PAD_PROBE_OK : GST_PAD_PROBE_HANDLED;
        }
        GstBufferList* list = gst_buffer_list_make_writable(GST_PAD_PROBE_INFO_BUFFER_LIST(info));
        gst_buffer_list_foreach(list, probe->each, &probe->by);
        info->data = list;
        if (gst_buffer_list_length(list) > 0) return GST_PAD_PROBE_OK;
        gst_buffer_list_unref(list);
        info->data = nullptr;
        return GST_PAD_PROBE_HANDLED;
      },
      new Probe{std::move(by), each}, [](gpointer data) { delete static_cast<Probe*>(data); });
}

GstBuffer* filter_compound(GstBuffer* compound) {
  GstMapInfo map;
  std::optional<std::vector<uint8_t>> needed = std::vector<uint8_t>();
  if (gst_buffer_map(compound, &map, GST_MAP_READ)) {
    needed = RtcpFilter::filter_compound({map.data, map.size});
    gst_buffer_unmap(compound, &map);
  }
  if (!needed) return compound;
  GstBuffer* rest = needed->empty() ? nullptr : gst_buffer_new_memdup(needed->data(), needed->size());
  if (rest) gst_buffer_copy_into(rest, compound, GST_BUFFER_COPY_METADATA, 0, -1);
  gst_buffer_unref(compound);
  return rest;
}

struct Reception {
  std::vector<ReceptionReport> reports;
  double round_trip = 0;  // seconds
};

gboolean read_stats(GQuark, const GValue* value, gpointer data) {
  Reception& received = *static_cast<Reception*>(data);
  if (!GST_VALUE_HOLDS_STRUCTURE(value)) return TRUE;
  const GstStructure* s = gst_value_get_structure(value);
  GstWebRTCStatsType type;
  g_autoptr(GstStructure) source = nullptr;
  if (!gst_structure_get(s, "type", GST_TYPE_WEBRTC_STATS_TYPE, &type, nullptr) ||
      type != GST_WEBRTC_STATS_REMOTE_INBOUND_RTP ||
      !gst_structure_get(s, "gst-rtpsource-stats", GST_TYPE_STRUCTURE, &source, nullptr))
    return TRUE;
  ReceptionReport report;
  if (gst_structure_get(source, "rb-ssrc", G_TYPE_UINT, &report.ssrc, "rb-exthighestseq", G_TYPE_UINT, &report.highest,
                        "rb-packetslost", G_TYPE_INT, &report.lost, nullptr))
    received.reports.push_back(report);
  gst_structure_get_double(s, "round-trip-time", &received.round_trip);
  return TRUE;
}

Reception read_reception(const GstStructure* stats) {
  Reception received;
  gst_structure_foreach(stats, read_stats, &received);
  return received;
}

// Counts the alerts that DTLS has sent.
using DtlsAlerts = std::shared_ptr<std::counting_semaphore<>>;

GstPadProbeReturn count_alert(GstPad*, GstPadProbeInfo* info, gpointer data) {
  constexpr guint8 kAlert = 21;  // DTLS ContentType, RFC 6347
  guint8 type = 0;
  if (gst_buffer_extract(GST_PAD_PROBE_INFO_BUFFER(info), 0, &type, 1) == 1 && type == kAlert)
    (*static_cast<DtlsAlerts*>(data))->release();
  return GST_PAD_PROBE_OK;
}

}  // namespace

Peer::Peer(GstElement* webrtc, Offer offer, uint32_t ssrc, Callbacks callbacks)
    : webrtc_(GST_ELEMENT(gst_object_ref(webrtc))),
      fingerprints_(offer.fingerprints),
      offer_(std::move(offer)),
      ssrc_(ssrc),
      callbacks_(std::move(callbacks)) {}

std::shared_ptr<Peer> Peer::make(GstElement* webrtc, Offer offer, uint32_t ssrc, const Route& route,
                                 Callbacks callbacks) {
  std::shared_ptr<Peer> peer(new Peer(webrtc, std::move(offer), ssrc, std::move(callbacks)));
  peer->watch(route);
  return peer;
}

Peer::~Peer() {
  if (channel_) g_signal_handlers_disconnect_matched(channel_, G_SIGNAL_MATCH_DETAIL, 0, 0, nullptr, nullptr, nullptr);
  g_clear_object(&channel_);
  g_clear_object(&surface_channel_);
  gst_clear_object(&dtls_);
  gst_object_unref(webrtc_);
}

void Peer::set_bit_rate(int bits_per_second) {
  const double bytes = kRetransmitShare * bits_per_second / 8;
  const std::lock_guard lock(mutex_);
  retransmit_limit_.set_rate(bytes, std::max(bytes, kRetransmitBurst), g_get_monotonic_time());
}

bool Peer::take_key_frame() {
  const std::lock_guard lock(mutex_);
  return key_frame_limit_.take(g_get_monotonic_time());
}

// The RTP session turns each sequence number of a request for lost packets (NACK) into an event for rtprtxsend.
GstPadProbeReturn Peer::on_retransmission_request(GstPad*, GstPadProbeInfo* info, gpointer data) {
  const GstStructure* structure = gst_event_get_structure(GST_PAD_PROBE_INFO_EVENT(info));
  if (!structure || !gst_structure_has_name(structure, "GstRTPRetransmissionRequest")) return GST_PAD_PROBE_OK;
  const auto peer = peer_of(data);
  if (!peer) return GST_PAD_PROBE_DROP;
  const std::lock_guard lock(peer->mutex_);
  return peer->retransmit_limit_.take(g_get_monotonic_time(), kRetransmitBytes) ? GST_PAD_PROBE_OK : GST_PAD_PROBE_DROP;
}

bool Peer::take(GstBuffer* packet) {
  if (failed_) return false;
  const int64_t now = g_get_monotonic_time();
  last_packet_time_ = now;
  GstMapInfo map;
  if (!gst_buffer_map(packet, &map, GST_MAP_READ)) return false;
  const bool taken = rtcp_.accept_encrypted({map.data, map.size}, now);
  gst_buffer_unmap(packet, &map);
  return taken;
}

void Peer::call_back(std::function<void(Peer&)> what) {
  on_main_thread([weak = weak_from_this(), what = std::move(what)] {
    if (const auto peer = weak.lock(); peer && !peer->has_left_) what(*peer);
  });
}

void Peer::fail(const std::string& why) {
  if (failed_.exchange(true)) return;
  call_back([why](Peer& peer) { peer.callbacks_.on_failed(why); });
}

void Peer::watch_element(GstElement* element) {
  GstElementFactory* factory = gst_element_get_factory(element);
  const std::string type = factory ? GST_OBJECT_NAME(factory) : "";
  // If clocksync synchronised, it would delay each picture by a frame.
  if (type == "clocksync") g_object_set(element, "sync", FALSE, nullptr);
  if (type == "dtlsenc") {
    const std::lock_guard lock(mutex_);
    gst_object_replace(reinterpret_cast<GstObject**>(&dtls_), GST_OBJECT(element));
  }
  // The certificate arrives before the keys, so no media are sent to a wrong peer.
  if (type == "dtlsdec")
    connect(
        element, "notify::peer-pem",
        +[](GObject* decoder, GParamSpec*, gpointer data) {
          g_autofree gchar* pem = nullptr;
          g_object_get(decoder, "peer-pem", &pem, nullptr);
          const auto peer = peer_of(data);
          if (!peer || (pem && has_fingerprint(pem, peer->fingerprints_))) return;
          peer->certificate_mismatch_ = true;
          peer->fail("its certificate does not match the offer");
        },
        weak_from_this());
  if (type == "nicesink") {
    g_autoptr(GstPad) sink = gst_element_get_static_pad(element, "sink");
    gst_pad_add_probe(
        sink, GstPadProbeType(GST_PAD_PROBE_TYPE_BUFFER | GST_PAD_PROBE_TYPE_BUFFER_LIST),
        [](GstPad*, GstPadProbeInfo*, gpointer data) {
          const auto peer = peer_of(data);
          return peer && peer->certificate_mismatch_ ? GST_PAD_PROBE_DROP : GST_PAD_PROBE_OK;
        },
        new Weak(weak_from_this()), [](gpointer data) { delete static_cast<Weak*>(data); });
  }
  if (type == "rtprtxsend") {
    g_autoptr(GstPad) src = gst_element_get_static_pad(element, "src");
    gst_pad_add_probe(src, GST_PAD_PROBE_TYPE_EVENT_UPSTREAM, on_retransmission_request, new Weak(weak_from_this()),
                      [](gpointer data) { delete static_cast<Weak*>(data); });
  }
  // Each SCTP stream would add a pad, elements and a thread, even without a data channel.
  if (type == "sctpdec")
    connect(
        element, "pad-added",
        +[](GstElement*, GstPad*, gpointer data) {
          const auto peer = peer_of(data);
          if (peer && ++peer->streams_ > kMaxStreams) peer->fail("it opens too many data channels");
        },
        weak_from_this());
  if (type == "nicesrc")
    filter(element, "src", [weak = weak_from_this()](GstBuffer* packet) -> GstBuffer* {
      const auto peer = weak.lock();
      if (peer && peer->take(packet)) return packet;
      gst_buffer_unref(packet);
      return nullptr;
    });
  if (type == "srtpdec") filter(element, "rtcp_src", filter_compound);
}

void Peer::watch(const Route& route) {
  connect(
      webrtc_, "deep-element-added",
      +[](GstBin*, GstBin*, GstElement* element, gpointer data) {
        if (const auto peer = peer_of(data)) peer->watch_element(element);
      },
      weak_from_this());
  connect(
      webrtc_, "on-data-channel",
      +[](GstElement*, GstWebRTCDataChannel* channel, gpointer data) {
        if (const auto peer = peer_of(data)) peer->open_channel(channel);
      },
      weak_from_this());
  connect(
      webrtc_, "notify::connection-state",
      +[](GstElement* webrtc, GParamSpec*, gpointer data) {
        GstWebRTCPeerConnectionState state;
        g_object_get(webrtc, "connection-state", &state, nullptr);
        const auto peer = peer_of(data);
        if (peer) peer->connection_changed(state);
      },
      weak_from_this());
  connect(
      webrtc_, "notify::ice-gathering-state",
      +[](GstElement*, GParamSpec*, gpointer data) {
        if (const auto peer = peer_of(data)) peer->answer(false);
      },
      weak_from_this());

  GObject *ice = nullptr, *agent = nullptr;
  g_object_get(webrtc_, "ice-agent", &ice, nullptr);
  g_object_get(ice, "agent", &agent, nullptr);
  g_object_set(agent, "upnp", FALSE, "ice-tcp", FALSE, nullptr);
  gboolean added = TRUE;
  if (!route.address.empty()) g_signal_emit_by_name(ice, "add-local-ip-address", route.address.c_str(), &added);
  for (const std::string& server : route.ice_servers) {
    if (server.starts_with("stun"))
      g_object_set(webrtc_, "stun-server", server.c_str(), nullptr);
    else
      g_signal_emit_by_name(webrtc_, "add-turn-server", server.c_str(), &added);
  }
  g_object_unref(agent);
  g_object_unref(ice);

  GstWebRTCRTPTransceiver* transceiver = nullptr;
  g_signal_emit_by_name(webrtc_, "get-transceiver", 0, &transceiver);
  g_object_set(transceiver, "direction", GST_WEBRTC_RTP_TRANSCEIVER_DIRECTION_SENDONLY, "do-nack", TRUE, nullptr);
  gst_object_unref(transceiver);
}

void Peer::connection_changed(int state) {
  if (state == GST_WEBRTC_PEER_CONNECTION_STATE_CONNECTED && !connected_.exchange(true))
    call_back([](Peer& peer) { peer.callbacks_.on_connected(); });
  if (state == GST_WEBRTC_PEER_CONNECTION_STATE_FAILED || state == GST_WEBRTC_PEER_CONNECTION_STATE_CLOSED)
    fail("the connection is lost");
}

// Announces the caps of the video, so that webrtcbin can answer before there is video. An answer without the SSRC of
// the stream would state SSRC 0 for retransmissions, and browsers would show black.
void Peer::announce() {
  GstCaps* caps =
      gst_caps_new_simple("application/x-rtp", "media", G_TYPE_STRING, "video", "clock-rate", G_TYPE_INT, 90000,
                          "encoding-name", G_TYPE_STRING, to_string(offer_.codec), "payload", G_TYPE_INT,
                          static_cast<gint>(offer_.payload_type), "ssrc", G_TYPE_UINT, ssrc_, nullptr);
  if (offer_.codec == VideoCodec::kH264) gst_caps_set_simple(caps, "packetization-mode", G_TYPE_STRING, "1", nullptr);
  if (offer_.playout_delay > 0)
    gst_caps_set_simple(caps, ("extmap-" + std::to_string(offer_.playout_delay)).c_str(), G_TYPE_STRING,
                        kPlayoutDelayUri, nullptr);
  g_autoptr(GstPad) sink = gst_element_get_static_pad(webrtc_, "sink_0");
  gst_pad_send_event(sink, gst_event_new_stream_start("video"));
  gst_pad_send_event(sink, gst_event_new_caps(caps));
  gst_caps_unref(caps);
}

void Peer::negotiate() {
  announce();
  GstWebRTCSessionDescription* remote =
      gst_webrtc_session_description_new(GST_WEBRTC_SDP_TYPE_OFFER, offer_.sdp.release());
  const auto made = [weak = weak_from_this()](const GstStructure* reply) {
    const auto peer = weak.lock();
    if (!peer) return;
    GstWebRTCSessionDescription* local = nullptr;
    if (reply) gst_structure_get(reply, "answer", GST_TYPE_WEBRTC_SESSION_DESCRIPTION, &local, nullptr);
    if (!local) return peer->fail(kOfferRejected);
    set_profile(local->sdp, peer->offer_);
    g_signal_emit_by_name(peer->webrtc_, "set-local-description", local, promise([weak](const GstStructure* set) {
                            const auto p = weak.lock();
                            if (p && is_error(set)) p->fail(kOfferRejected);
                          }));
    gst_webrtc_session_description_free(local);
  };
  const auto taken = [weak = weak_from_this(), made](const GstStructure* reply) {
    const auto peer = weak.lock();
    if (!peer) return;
    if (is_error(reply)) return peer->fail(kOfferRejected);
    g_signal_emit_by_name(peer->webrtc_, "create-answer", nullptr, promise(made));
  };
  g_signal_emit_by_name(webrtc_, "set-remote-description", remote, promise(taken));
  gst_webrtc_session_description_free(remote);
  g_timeout_add_full(
      G_PRIORITY_DEFAULT, kGathering,
      [](gpointer data) -> gboolean {
        if (const auto peer = peer_of(data)) peer->answer(true);
        return G_SOURCE_REMOVE;
      },
      new Weak(weak_from_this()), [](gpointer data) { delete static_cast<Weak*>(data); });
}

void Peer::answer(bool late) {
  GstWebRTCICEGatheringState state;
  GstWebRTCSessionDescription* local = nullptr;
  g_object_get(webrtc_, "ice-gathering-state", &state, "local-description", &local, nullptr);
  if ((late || state == GST_WEBRTC_ICE_GATHERING_STATE_COMPLETE) && local && !answered_.exchange(true)) {
    g_autofree gchar* text = gst_sdp_message_as_text(local->sdp);
    call_back([sdp = std::string(text)](Peer& peer) { peer.callbacks_.on_answer(sdp); });
  }
  if (local) gst_webrtc_session_description_free(local);
}

// The channel may already be open. It stays, because webrtcbin crashes (use after free) when a single channel is
// closed.
void Peer::open_channel(GstWebRTCDataChannel* channel) {
  g_autofree gchar* label = nullptr;
  g_object_get(channel, "label", &label, nullptr);
  const std::lock_guard lock(mutex_);
  if (!surface_channel_ && g_strcmp0(label, "surface") == 0) {
    surface_channel_ = static_cast<GstWebRTCDataChannel*>(g_object_ref(channel));
    takes_surfaces_ = true;
    return;
  }
  if (channel_ || g_strcmp0(label, "control") != 0) return fail("it opens an unknown data channel");
  channel_ = static_cast<GstWebRTCDataChannel*>(g_object_ref(channel));
  connect(
      channel, "on-message-string",
      +[](GstWebRTCDataChannel*, const gchar* text, gpointer data) {
        const auto peer = peer_of(data);
        if (peer && text) peer->callbacks_.on_message(text);
      },
      weak_from_this());
}

// Returns a new reference to a channel, or null if it is not open, or if at least `max_waiting` bytes wait to be sent.
GstWebRTCDataChannel* Peer::open_for_sending(GstWebRTCDataChannel* Peer::*which, uint64_t max_waiting) {
  GstWebRTCDataChannel* channel = nullptr;
  {
    const std::lock_guard lock(mutex_);
    if (!(this->*which)) return nullptr;
    channel = static_cast<GstWebRTCDataChannel*>(g_object_ref(this->*which));
  }
  GstWebRTCDataChannelState state;
  guint64 waiting = 0;
  g_object_get(channel, "ready-state", &state, "buffered-amount", &waiting, nullptr);
  if (state == GST_WEBRTC_DATA_CHANNEL_STATE_OPEN && waiting < max_waiting) return channel;
  g_object_unref(channel);
  return nullptr;
}

void Peer::send(const std::string& text) {
  constexpr uint64_t kMaxWaiting = 65536;
  GstWebRTCDataChannel* channel = open_for_sending(&Peer::channel_, kMaxWaiting);
  if (!channel) return;
  gst_webrtc_data_channel_send_string(channel, text.c_str());
  g_object_unref(channel);
}

void Peer::send_surface(std::span<const uint8_t> message) {
  constexpr uint64_t kMaxWaiting = 4096;  // later messages are more useful than waiting ones
  GstWebRTCDataChannel* channel = open_for_sending(&Peer::surface_channel_, kMaxWaiting);
  if (!channel) return;
  g_autoptr(GBytes) bytes = g_bytes_new(message.data(), message.size());
  gst_webrtc_data_channel_send_data(channel, bytes);
  g_object_unref(channel);
}

void Peer::close_dtls() {
  g_autoptr(GstElement) dtls = nullptr;
  {
    const std::lock_guard lock(mutex_);
    if (connected_ && dtls_) dtls = GST_ELEMENT(gst_object_ref(dtls_));
  }
  if (!dtls) return;
  const auto alerts = std::make_shared<std::counting_semaphore<>>(0);
  g_autoptr(GstPad) src = gst_element_get_static_pad(dtls, "src");
  const gulong probe = !src ? 0
                            : gst_pad_add_probe(src, GST_PAD_PROBE_TYPE_BUFFER, count_alert, new DtlsAlerts(alerts),
                                                [](gpointer data) { delete static_cast<DtlsAlerts*>(data); });
  gst_element_foreach_sink_pad(
      dtls,
      [](GstElement*, GstPad* pad, gpointer) -> gboolean {
        gst_pad_send_event(pad, gst_event_new_eos());
        return TRUE;
      },
      nullptr);
  if (probe == 0) return;
  // The sending thread must not be stopped before DTLS has sent its closing alert.
  constexpr std::chrono::milliseconds kLongest{250};
  (void)alerts->try_acquire_for(kLongest);
  gst_pad_remove_probe(src, probe);
}

void Peer::ask_for_report() {
  g_signal_emit_by_name(webrtc_, "get-stats", nullptr, promise([weak = weak_from_this()](const GstStructure* stats) {
                          const auto asked = weak.lock();
                          if (!stats || !asked) return;
                          asked->call_back([received = read_reception(stats)](Peer& peer) {
                            const double loss = peer.loss_.update(received.reports);
                            peer.callbacks_.on_report({loss, received.round_trip});
                          });
                        }));
}

}  // namespace lf::serve
