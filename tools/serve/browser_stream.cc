// SPDX-License-Identifier: LGPL-2.1-or-later
#include "serve/browser_stream.h"

#include <algorithm>

#include <gst/video/video.h>

#include "serve/pipelines.h"

namespace lf::serve {

BrowserStream::BrowserStream(LightField& field, const std::string& line, Callbacks callbacks)
    : field_(field), callbacks_(std::move(callbacks)), began_(g_get_monotonic_time()) {
  video_ = launch(line, true);
  webrtc_ = gst_element_factory_make("webrtcbin", nullptr);
  if (!webrtc_) {
    gst_object_unref(video_);
    throw Error("element webrtcbin is not installed");
  }
  gst_util_set_object_arg(G_OBJECT(webrtc_), "bundle-policy", "max-bundle");
  pipeline_ = GST_ELEMENT(gst_object_ref_sink(gst_pipeline_new(nullptr)));
  gst_bin_add_many(GST_BIN(pipeline_), video_, webrtc_, nullptr);
  gst_element_link(video_, webrtc_);
}

void BrowserStream::watch_payloader(GstElement* payloader) {
  g_autoptr(GstPad) out = gst_element_get_static_pad(payloader, "src");
  gst_pad_add_probe(
      out, GstPadProbeType(GST_PAD_PROBE_TYPE_BUFFER | GST_PAD_PROBE_TYPE_BUFFER_LIST),
      [](GstPad*, GstPadProbeInfo* info, gpointer data) {
        *static_cast<std::atomic<uint64_t>*>(data) +=
            GST_PAD_PROBE_INFO_TYPE(info) & GST_PAD_PROBE_TYPE_BUFFER_LIST
                ? gst_buffer_list_calculate_size(GST_PAD_PROBE_INFO_BUFFER_LIST(info))
                : gst_buffer_get_size(GST_PAD_PROBE_INFO_BUFFER(info));
        return GST_PAD_PROBE_OK;
      },
      &video_bytes_, nullptr);
  gst_pad_add_probe(
      out, GST_PAD_PROBE_TYPE_EVENT_UPSTREAM,
      [](GstPad*, GstPadProbeInfo* info, gpointer data) {
        auto* self = static_cast<BrowserStream*>(data);
        if (!gst_video_event_is_force_key_unit(GST_PAD_PROBE_INFO_EVENT(info))) return GST_PAD_PROBE_OK;
        return self->peer_->take_key_frame() && self->key_frame_requested() ? GST_PAD_PROBE_OK : GST_PAD_PROBE_DROP;
      },
      this, nullptr);
}

void BrowserStream::connect(Offer offer, const Route& route, GstClockTime base_time) {
  const uint32_t ssrc = std::max<uint32_t>(g_random_int(), 1);
  g_autoptr(GstElement) payloader = gst_bin_get_by_name(GST_BIN(video_), "payloader");
  if (offer.playout_delay > 0) add_playout_delay(payloader, offer.playout_delay);
  g_object_set(payloader, "ssrc", ssrc, nullptr);
  watch_payloader(payloader);
  peer_ = Peer::make(webrtc_, std::move(offer), ssrc, route,
                     {callbacks_.on_answer,
                      [this] {
                        start_video();
                        callbacks_.on_connected();
                      },
                      callbacks_.on_gone, [this](const std::string& text) { control(text); },
                      [this](const LinkReport& link) { report(link); }});

  g_autoptr(GstBus) bus = gst_element_get_bus(pipeline_);
  watch_ = gst_bus_add_watch(bus, bus_message, this);
  gst_pipeline_use_clock(GST_PIPELINE(pipeline_), field_.clock());
  gst_element_set_start_time(pipeline_, GST_CLOCK_TIME_NONE);
  gst_element_set_base_time(pipeline_, base_time);
  gst_element_set_state(video_, GST_STATE_READY);
  gst_element_set_locked_state(video_, TRUE);
  gst_element_set_state(pipeline_, GST_STATE_PLAYING);
  peer_->negotiate();
}

void BrowserStream::start_video() {
  gst_element_set_base_time(video_, gst_element_get_base_time(pipeline_));
  gst_element_set_locked_state(video_, FALSE);
  gst_element_sync_state_with_parent(video_);
}

void BrowserStream::leave() {
  g_source_remove(watch_);
  peer_->leave();
}

void BrowserStream::stop() {
  if (peer_) peer_->close_dtls();
  gst_element_set_locked_state(video_, TRUE);
  gst_element_set_state(video_, GST_STATE_NULL);
  gst_element_set_state(pipeline_, GST_STATE_NULL);
  peer_.reset();
}

BrowserStream::~BrowserStream() { gst_object_unref(pipeline_); }

gboolean BrowserStream::bus_message(GstBus*, GstMessage* message, gpointer data) {
  BrowserStream* self = static_cast<BrowserStream*>(data);
  switch (GST_MESSAGE_TYPE(message)) {
    case GST_MESSAGE_LATENCY: gst_bin_recalculate_latency(GST_BIN(self->pipeline_)); break;
    case GST_MESSAGE_ERROR: self->callbacks_.on_gone(text_of(message)); break;
    default: break;
  }
  return G_SOURCE_CONTINUE;
}

void BrowserStream::tick(double busy) {
  busy_ = busy;
  if (connected()) peer_->ask_for_report();
}

double BrowserStream::silence(int64_t now) const {
  return static_cast<double>(now - (connected() ? std::max(peer_->last_packet_time(), began_) : began_)) * 1e-6;
}

ViewerCounters BrowserStream::counters() const { return {.video_bytes = video_bytes_}; }

}  // namespace lf::serve
