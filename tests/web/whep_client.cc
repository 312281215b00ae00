// SPDX-License-Identifier: LGPL-2.1-or-later
#include "web/whep_client.h"

#define GST_USE_UNSTABLE_API
#include <gst/rtp/gstrtpbuffer.h>
#include <gst/webrtc/webrtc.h>
#include <libsoup/soup.h>

#include <cstring>
#include <regex>
#include <stdexcept>

#include "support/process.h"

namespace lf::test {
namespace {

// Returns the reply of a webrtcbin call; the caller frees it.
GstStructure* call(GstElement* webrtc, const char* signal, gpointer argument, bool has_argument = true) {
  GstPromise* promise = gst_promise_new();
  if (has_argument)
    g_signal_emit_by_name(webrtc, signal, argument, promise);
  else
    g_signal_emit_by_name(webrtc, signal, nullptr, promise);
  gst_promise_wait(promise);
  const GstStructure* reply = gst_promise_get_reply(promise);
  GstStructure* copy = reply ? gst_structure_copy(reply) : nullptr;
  gst_promise_unref(promise);
  return copy;
}

void describe(GstElement* webrtc, const char* signal, GstWebRTCSessionDescription* description) {
  g_autoptr(GstStructure) reply = call(webrtc, signal, description);
  const bool failed = reply && gst_structure_has_field(reply, "error");
  gst_webrtc_session_description_free(description);
  if (failed) throw std::runtime_error(std::string(signal) + " fails");
}

template <typename Condition>
void wait_for(const char* what, double seconds, const Condition& condition) {
  for (double waited = 0; !condition(); waited += 0.005) {
    if (waited > seconds) throw std::runtime_error(std::string("never: ") + what);
    g_usleep(5000);
  }
}

}  // namespace

WhepClient::WhepClient(GstElement* pipeline, const Options& options)
    : options_(options), pipeline_(GST_ELEMENT(gst_object_ref_sink(pipeline))), loss_(options.loss) {}

// The delegated constructor has finished, so an exception here runs the destructor and stops all threads.
WhepClient::WhepClient(const Options& options) : WhepClient(gst_pipeline_new(nullptr), options) {
  webrtc_ = gst_element_factory_make("webrtcbin", nullptr);
  if (!webrtc_) throw std::runtime_error("element webrtcbin is not installed");
  gst_util_set_object_arg(G_OBJECT(webrtc_), "bundle-policy", "max-bundle");
  // avoids losing late packets on a busy machine
  if (options.loss > 0) g_object_set(webrtc_, "latency", 2000u, nullptr);
  gst_bin_add(GST_BIN(pipeline_), webrtc_);
  g_signal_connect(webrtc_, "pad-added", G_CALLBACK(pad_added), this);
  g_signal_connect(webrtc_, "deep-element-added", G_CALLBACK(transport_added), this);
  GObject *ice = nullptr, *agent = nullptr;
  gboolean added = FALSE;
  g_object_get(webrtc_, "ice-agent", &ice, nullptr);
  g_object_get(ice, "agent", &agent, nullptr);
  g_object_set(agent, "upnp", FALSE, "ice-tcp", FALSE, nullptr);
  g_signal_emit_by_name(ice, "add-local-ip-address", options.address.c_str(), &added);
  g_object_unref(agent);
  g_object_unref(ice);
  gst_element_set_state(pipeline_, GST_STATE_PLAYING);

  g_signal_emit_by_name(webrtc_, "create-data-channel", "control", nullptr, &channel_);
  if (!channel_) throw std::runtime_error("no data channel");
  g_signal_connect(channel_, "on-message-string",
                   G_CALLBACK(+[](GstWebRTCDataChannel*, const gchar* text, gpointer data) {
                     WhepClient* self = static_cast<WhepClient*>(data);
                     const std::lock_guard lock(self->mutex_);
                     self->messages_.push_back(text ? text : "");
                   }),
                   this);
  g_signal_connect(channel_, "on-open", G_CALLBACK(+[](GstWebRTCDataChannel* channel, gpointer data) {
                     const std::string& text = static_cast<WhepClient*>(data)->options_.first_message;
                     if (!text.empty()) gst_webrtc_data_channel_send_string(channel, text.c_str());
                   }),
                   this);
  g_autoptr(GstCaps) caps = gst_caps_from_string(
      options.vp8 ? "application/x-rtp,media=video,encoding-name=VP8,payload=96,clock-rate=90000"
                  : "application/x-rtp,media=video,encoding-name=H264,payload=108,clock-rate=90000,"
                    "packetization-mode=(string)1,profile-level-id=(string)42e01f");
  if (options.playout_delay)
    gst_caps_set_simple(caps, ("extmap-" + std::to_string(kPlayoutDelay)).c_str(), G_TYPE_STRING,
                        "http://www.webrtc.org/experiments/rtp-hdrext/playout-delay", nullptr);
  GstWebRTCRTPTransceiver* transceiver = nullptr;
  g_signal_emit_by_name(webrtc_, "add-transceiver", GST_WEBRTC_RTP_TRANSCEIVER_DIRECTION_RECVONLY, caps, &transceiver);
  g_object_set(transceiver, "do-nack", TRUE, nullptr);
  gst_object_unref(transceiver);

  g_autoptr(GstStructure) reply = call(webrtc_, "create-offer", nullptr, false);
  GstWebRTCSessionDescription* offer = nullptr;
  if (reply) gst_structure_get(reply, "offer", GST_TYPE_WEBRTC_SESSION_DESCRIPTION, &offer, nullptr);
  if (!offer) throw std::runtime_error("no offer");
  g_autofree gchar* text = gst_sdp_message_as_text(offer->sdp);
  describe(webrtc_, "set-local-description", offer);
  std::string posted = text;
  if (!options.fingerprint.empty())
    posted = std::regex_replace(posted, std::regex("(a=fingerprint:)[^\r]*"), "$1" + options.fingerprint);
  post(posted);
  GstSDPMessage* sdp = nullptr;
  if (gst_sdp_message_new_from_text(answer_.c_str(), &sdp) != GST_SDP_OK) throw std::runtime_error(answer_);
  describe(webrtc_, "set-remote-description", gst_webrtc_session_description_new(GST_WEBRTC_SDP_TYPE_ANSWER, sdp));
  wait_for("a picture", options.patience, [this] { return pictures_ > 0; });
}

WhepClient::~WhepClient() {
  if (!session_.empty() && !vanished_) {
    g_autoptr(SoupSession) session = soup_session_new();
    g_autoptr(SoupMessage) message = soup_message_new("DELETE", session_.c_str());
    g_autoptr(GBytes) bytes = soup_session_send_and_read(session, message, nullptr, nullptr);
  }
  gst_element_set_state(pipeline_, GST_STATE_NULL);
  if (channel_) g_object_unref(channel_);
  if (other_) g_object_unref(other_);
  gst_object_unref(pipeline_);
}

void WhepClient::post(const std::string& offer) {
  g_autoptr(SoupSession) session = soup_session_new();
  const std::string url = options_.url + "whep?width=" + std::to_string(options_.width) +
                          "&height=" + std::to_string(options_.height) + options_.query;
  g_autoptr(SoupMessage) message = soup_message_new("POST", url.c_str());
  g_autoptr(GBytes) body = g_bytes_new(offer.data(), offer.size());
  soup_message_set_request_body_from_bytes(message, "application/sdp", body);
  g_autoptr(GBytes) bytes = soup_session_send_and_read(session, message, nullptr, nullptr);
  gsize size = 0;
  const char* data = bytes ? static_cast<const char*>(g_bytes_get_data(bytes, &size)) : nullptr;
  answer_.assign(data ? data : "", size);
  const guint status = soup_message_get_status(message);
  const char* location = soup_message_headers_get_one(soup_message_get_response_headers(message), "Location");
  if (location) session_ = options_.url + (location + 1);
  if (status != 201) throw std::runtime_error(std::to_string(status) + " " + answer_);
}

void WhepClient::transport_added(GstBin*, GstBin*, GstElement* element, gpointer data) {
  GstElementFactory* factory = gst_element_get_factory(element);
  const std::string kind = factory ? GST_OBJECT_NAME(factory) : "";
  if (kind == "dtlsdec") static_cast<WhepClient*>(data)->dtls_ = element;
  if (kind == "srtpenc") static_cast<WhepClient*>(data)->srtp_ = element;
  if (kind == "rtpsession") {  // reports as often as browsers
    GObject* session = nullptr;
    g_object_get(element, "internal-session", &session, nullptr);
    g_object_set(session, "rtcp-min-interval", guint64{GST_SECOND / 2}, nullptr);
    g_object_unref(session);
  }
  if (kind != "nicesrc" && kind != "nicesink") return;
  const bool in = kind == "nicesrc";
  g_autoptr(GstPad) pad = gst_element_get_static_pad(element, in ? "src" : "sink");
  gst_pad_add_probe(pad, GstPadProbeType(GST_PAD_PROBE_TYPE_BUFFER | GST_PAD_PROBE_TYPE_BUFFER_LIST),
                    in ? rtp_received : rtp_sent, data, nullptr);
}

// Drops only media (RFC 7983); other tests cover the connection.
GstPadProbeReturn WhepClient::rtp_received(GstPad*, GstPadProbeInfo* info, gpointer data) {
  WhepClient* self = static_cast<WhepClient*>(data);
  if (self->vanished_) return GST_PAD_PROBE_DROP;
  self->received_ += GST_PAD_PROBE_INFO_TYPE(info) & GST_PAD_PROBE_TYPE_BUFFER
                         ? gst_buffer_get_size(GST_PAD_PROBE_INFO_BUFFER(info))
                         : gst_buffer_list_calculate_size(GST_PAD_PROBE_INFO_BUFFER_LIST(info));
  if (!(GST_PAD_PROBE_INFO_TYPE(info) & GST_PAD_PROBE_TYPE_BUFFER)) return GST_PAD_PROBE_OK;
  guint8 first = 0;
  gst_buffer_extract(GST_PAD_PROBE_INFO_BUFFER(info), 0, &first, 1);
  guint8 header[12] =
      {};  // RTP header, unencrypted in SRTP; RTCP types from 192 are in the place of RTP's payload type
  const bool is_rtp = first >= 128 && first < 192 &&
                      gst_buffer_extract(GST_PAD_PROBE_INFO_BUFFER(info), 0, header, sizeof header) == sizeof header &&
                      (header[1] < 192 || header[1] > 223);
  if (is_rtp && self->ssrc_ != 0 && GST_READ_UINT32_BE(header + 8) != self->ssrc_) self->repeated_++;
  if (first < 128 || first >= 192 || g_random_double() >= self->loss_) return GST_PAD_PROBE_OK;
  self->lost_++;
  return GST_PAD_PROBE_DROP;
}

GstPadProbeReturn WhepClient::rtp_sent(GstPad*, GstPadProbeInfo*, gpointer data) {
  return static_cast<WhepClient*>(data)->vanished_ ? GST_PAD_PROBE_DROP : GST_PAD_PROBE_OK;
}

void WhepClient::pad_added(GstElement*, GstPad* pad, gpointer data) {
  WhepClient* self = static_cast<WhepClient*>(data);
  if (GST_PAD_DIRECTION(pad) != GST_PAD_SRC) return;
  GstElement* sink = gst_element_factory_make("fakesink", nullptr);
  g_object_set(sink, "sync", FALSE, "async", FALSE, nullptr);
  gst_bin_add(GST_BIN(self->pipeline_), sink);
  gst_element_sync_state_with_parent(sink);
  g_autoptr(GstPad) in = gst_element_get_static_pad(sink, "sink");
  gst_pad_add_probe(in, GST_PAD_PROBE_TYPE_BUFFER, packet, self, nullptr);
  gst_pad_link(pad, in);
}

GstPadProbeReturn WhepClient::packet(GstPad*, GstPadProbeInfo* info, gpointer data) {
  WhepClient* self = static_cast<WhepClient*>(data);
  GstBuffer* buffer = GST_PAD_PROBE_INFO_BUFFER(info);
  self->bytes_ += gst_buffer_get_size(buffer);
  guint8 header[12] = {};  // RFC 3550, 5.1: marker and payload type, sequence number, time, source
  gst_buffer_extract(buffer, 0, header, sizeof header);
  self->ssrc_ = GST_READ_UINT32_BE(header + 8);
  const int sequence = GST_READ_UINT16_BE(header + 2);
  if (self->sequence_ >= 0) self->gaps_ += static_cast<uint16_t>(sequence - self->sequence_ - 1);
  self->sequence_ = sequence;
  if (header[1] & 0x80) self->pictures_++;
  GstRTPBuffer rtp = GST_RTP_BUFFER_INIT;
  gpointer delay = nullptr;
  guint size = 0;
  if (!gst_rtp_buffer_map(buffer, GST_MAP_READ, &rtp)) return GST_PAD_PROBE_OK;
  constexpr guint8 kNone[3] = {};
  if (gst_rtp_buffer_get_extension_onebyte_header(&rtp, kPlayoutDelay, 0, &delay, &size) && size == sizeof kNone &&
      std::memcmp(delay, kNone, size) == 0)
    self->undelayed_++;
  gst_rtp_buffer_unmap(&rtp);
  return GST_PAD_PROBE_OK;
}

void WhepClient::send(const std::string& text) {
  wait_for("an open channel", options_.patience, [this] {
    GstWebRTCDataChannelState state;
    g_object_get(channel_, "ready-state", &state, nullptr);
    return state == GST_WEBRTC_DATA_CHANNEL_STATE_OPEN;
  });
  gst_webrtc_data_channel_send_string(channel_, text.c_str());
}

// RFC 4585, 6.1, after a receiver report without blocks.
void WhepClient::send_feedback(uint8_t type, uint8_t format, const std::vector<uint8_t>& control) {
  constexpr guint8 kReport[] = {0x80, 201, 0, 1, 0, 0, 0x12, 0x34};
  std::vector<guint8> packet(std::begin(kReport), std::end(kReport));
  const auto words = static_cast<guint8>(2 + control.size() / 4);
  packet.insert(packet.end(), {static_cast<guint8>(0x80 | format), type, 0, words, 0, 0, 0x12, 0x34});
  const uint32_t ssrc = ssrc_;
  for (int shift = 24; shift >= 0; shift -= 8) packet.push_back(static_cast<guint8>(ssrc >> shift));
  packet.insert(packet.end(), control.begin(), control.end());
  GstPad* rtcp = nullptr;
  gst_element_foreach_sink_pad(
      srtp_,
      [](GstElement*, GstPad* pad, gpointer found) -> gboolean {
        if (!g_str_has_prefix(GST_PAD_NAME(pad), "rtcp")) return TRUE;
        *static_cast<GstPad**>(found) = pad;
        return FALSE;
      },
      &rtcp);
  if (!rtcp) throw std::runtime_error("srtpenc has no pad for RTCP");
  // The stream begins with the first report of the client.
  const auto has_begun = [rtcp] {
    g_autoptr(GstEvent) segment = gst_pad_get_sticky_event(rtcp, GST_EVENT_SEGMENT, 0);
    return segment != nullptr;
  };
  for (int waited = 0; !has_begun(); waited++) {
    if (waited > 3000) throw std::runtime_error("the client sends no RTCP");
    g_usleep(20000);
  }
  gst_pad_chain(rtcp, gst_buffer_new_memdup(packet.data(), packet.size()));
}

void WhepClient::ask_again() {
  std::vector<uint8_t> control;
  for (int i = 1; i <= 4; i++) {  // each names a packet and the next sixteen
    const int first = sequence_ - 17 * i;
    control.insert(control.end(), {static_cast<uint8_t>(first >> 8), static_cast<uint8_t>(first), 0xff, 0xff});
  }
  constexpr uint8_t kTransportFeedback = 205, kNack = 1;
  send_feedback(kTransportFeedback, kNack, control);
}

void WhepClient::ask_for_key_frame() {
  constexpr uint8_t kPayloadFeedback = 206, kPli = 1;
  send_feedback(kPayloadFeedback, kPli, {});
}

void WhepClient::open_channel(const std::string& label) {
  g_signal_emit_by_name(webrtc_, "create-data-channel", label.c_str(), nullptr, &other_);
  if (!other_) throw std::runtime_error("no data channel");
}

bool WhepClient::ended() const {
  constexpr int kClosed = 1;  // GstDtlsConnectionState
  int state = 0;
  g_object_get(dtls_, "connection-state", &state, nullptr);
  return state == kClosed;
}

std::vector<std::string> WhepClient::messages() const {
  const std::lock_guard lock(mutex_);
  return messages_;
}

}  // namespace lf::test
