// SPDX-License-Identifier: LGPL-2.1-or-later
#include "serve/viewer.h"

#include <cmath>

#include <gst/video/video.h>
#include <nlohmann/json.hpp>

#include "serve/adaptation.h"
#include "serve/pipelines.h"
#include "serve/process.h"

namespace lf::serve {
namespace {

using nlohmann::json;

// Maximum number of requests in flight. Over a network, a round trip may take longer than a frame.
constexpr int kMaxLocal = 2, kMaxRemote = 4;
constexpr int kMinBitRate = 100000;

uint64_t count_in(const GstStructure* stats, const char* name) {
  guint64 value = 0;
  gst_structure_get_uint64(stats, name, &value);
  return value;
}

uint32_t rtp_timestamp(GstClockTime running_time) {
  return static_cast<uint32_t>(gst_util_uint64_scale_int(running_time, 90000, GST_SECOND));
}

}  // namespace

Viewer::Viewer(LightField& field, Offer offer, const ViewSettings& settings, double max_aperture, const Route& route,
               Callbacks callbacks)
    : field_(field),
      settings_(settings),
      max_aperture_(max_aperture),
      callbacks_(std::move(callbacks)),
      began_(g_get_monotonic_time()),
      pacer_(field.is_local() ? kMaxLocal : kMaxRemote),
      quality_(std::min(kMinBitRate, settings.max_bit_rate()), settings.max_bit_rate(),
               static_cast<double>(settings.params.width) * settings.params.height * settings.limits.framerate),
      messages_(settings.limits.messages_per_second, 2 * settings.limits.messages_per_second) {
  video_ = launch(ViewerPipeline::launch_line(field.nodes()) + encoder_line(offer, settings.max_bit_rate()), true);
  GstElement* webrtc = gst_element_factory_make("webrtcbin", nullptr);
  if (!webrtc) {
    gst_object_unref(video_);
    throw Error("element webrtcbin is not installed");
  }
  gst_util_set_object_arg(G_OBJECT(webrtc), "bundle-policy", "max-bundle");
  pipeline_ = GST_ELEMENT(gst_object_ref_sink(gst_pipeline_new(nullptr)));
  gst_bin_add_many(GST_BIN(pipeline_), video_, webrtc, nullptr);
  gst_element_link(video_, webrtc);
  const auto find = [this](const std::string& name) { return gst_bin_get_by_name(GST_BIN(video_), name.c_str()); };
  encoder_ = find("encoder");
  encoder_name_ = GST_OBJECT_NAME(gst_element_get_factory(encoder_));
  view_pipeline_ =
      std::make_unique<ViewerPipeline>(video_, field, settings, [this](GstClockTime time) { requested(time); });
  update_pacer();
  watch_encoder();

  const uint32_t ssrc = std::max<uint32_t>(g_random_int(), 1);
  g_autoptr(GstElement) payloader = find("payloader");
  if (offer.playout_delay > 0) add_playout_delay(payloader, offer.playout_delay);
  g_object_set(payloader, "ssrc", ssrc, nullptr);
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
        const bool key = gst_video_event_is_force_key_unit(GST_PAD_PROBE_INFO_EVENT(info));
        return !key || static_cast<Viewer*>(data)->peer_->take_key_frame() ? GST_PAD_PROBE_OK : GST_PAD_PROBE_DROP;
      },
      this, nullptr);

  peer_ = Peer::make(webrtc, std::move(offer), ssrc, route,
                     {callbacks_.on_answer,
                      [this] {
                        start_video();
                        callbacks_.on_connected();
                      },
                      callbacks_.on_gone, [this](const std::string& text) { control(text); },
                      [this](const LinkReport& link) { report(link); }});

  g_autoptr(GstBus) bus = gst_element_get_bus(pipeline_);
  watch_ = gst_bus_add_watch(bus, bus_message, this);
  gst_pipeline_use_clock(GST_PIPELINE(pipeline_), field.clock());
  set_request_phase();
  gst_element_set_state(video_, GST_STATE_READY);
  gst_element_set_locked_state(video_, TRUE);
  gst_element_set_state(pipeline_, GST_STATE_PLAYING);
  peer_->negotiate();
}

// Requests are sent at multiples of the frame duration in running time, so the base time sets their phase.
void Viewer::set_request_phase() {
  const GstClockTime period = GST_SECOND / static_cast<uint64_t>(settings_.limits.framerate);
  const GstClockTime now = gst_clock_get_time(field_.clock());
  const auto turn = static_cast<GstClockTime>(request_phase(settings_.id) * static_cast<double>(period));
  gst_element_set_start_time(pipeline_, GST_CLOCK_TIME_NONE);
  gst_element_set_base_time(pipeline_, now - (now - turn) % period);
}

void Viewer::start_video() {
  gst_element_set_base_time(video_, gst_element_get_base_time(pipeline_));
  gst_element_set_locked_state(video_, FALSE);
  gst_element_sync_state_with_parent(video_);
  for (std::vector<std::string> early;; early.clear()) {
    {
      const std::lock_guard lock(mutex_);
      early.swap(early_messages_);
      video_started_ = early.empty();
    }
    if (early.empty()) return;
    for (const std::string& text : early) handle_control(text);
  }
}

void Viewer::leave() {
  view_pipeline_->close();
  g_source_remove(watch_);
  peer_->leave();
}

Viewer::~Viewer() {
  peer_->close_dtls();
  gst_element_set_locked_state(video_, TRUE);
  gst_element_set_state(video_, GST_STATE_NULL);
  gst_element_set_state(pipeline_, GST_STATE_NULL);
  peer_.reset();
  view_pipeline_.reset();
  gst_object_unref(encoder_);
  gst_object_unref(pipeline_);
}

void Viewer::update_pacer() {
  gst_pad_add_probe(
      view_pipeline_->requests(), GST_PAD_PROBE_TYPE_BUFFER,
      [](GstPad*, GstPadProbeInfo* info, gpointer data) {
        GstBuffer* request = GST_PAD_PROBE_INFO_BUFFER(info);
        if (is_probe(request)) return GST_PAD_PROBE_OK;
        const GstClockTime time = GST_BUFFER_PTS(request);
        return static_cast<RequestPacer*>(data)->begin(time) ? GST_PAD_PROBE_OK : GST_PAD_PROBE_DROP;
      },
      &pacer_, nullptr);
  g_autoptr(GstPad) pictures = gst_element_get_static_pad(view_pipeline_->compositor(), "src");
  gst_pad_add_probe(
      pictures, GST_PAD_PROBE_TYPE_BUFFER,
      [](GstPad*, GstPadProbeInfo* info, gpointer data) {
        static_cast<RequestPacer*>(data)->end(GST_BUFFER_PTS(GST_PAD_PROBE_INFO_BUFFER(info)));
        return GST_PAD_PROBE_OK;
      },
      &pacer_, nullptr);
}

void Viewer::watch_encoder() {
  g_autoptr(GstPad) encoded = gst_element_get_static_pad(encoder_, "src");
  gst_pad_add_probe(
      encoded, GST_PAD_PROBE_TYPE_BUFFER,
      [](GstPad* pad, GstPadProbeInfo* info, gpointer data) {
        static_cast<Viewer*>(data)->send_surface(pad, GST_PAD_PROBE_INFO_BUFFER(info));
        return GST_PAD_PROBE_OK;
      },
      this, nullptr);
}

void Viewer::send_surface(GstPad* encoded, GstBuffer* picture) {
  GstCustomMeta* meta = peer_->takes_surfaces() ? gst_buffer_get_custom_meta(picture, "lightfield-view") : nullptr;
  g_autoptr(GstEvent) event = meta ? gst_pad_get_sticky_event(encoded, GST_EVENT_SEGMENT, 0) : nullptr;
  if (!event) return;
  const GstSegment* segment = nullptr;
  gst_event_parse_segment(event, &segment);
  const GstClockTime time = gst_segment_to_running_time(segment, GST_FORMAT_TIME, GST_BUFFER_PTS(picture));
  for (const SurfaceSender::Message& message :
       surfaces_.messages(gst_custom_meta_get_structure(meta), rtp_timestamp(time), gst_buffer_get_size(picture))) {
    surface_bytes_ += message.size();
    peer_->send_surface(message);
  }
}

gboolean Viewer::bus_message(GstBus*, GstMessage* message, gpointer data) {
  Viewer* self = static_cast<Viewer*>(data);
  switch (GST_MESSAGE_TYPE(message)) {
    case GST_MESSAGE_LATENCY: gst_bin_recalculate_latency(GST_BIN(self->pipeline_)); break;
    case GST_MESSAGE_ERROR: self->callbacks_.on_gone(text_of(message)); break;
    default: break;
  }
  return G_SOURCE_CONTINUE;
}

GstClockTime Viewer::running_time() const {
  return gst_clock_get_time(field_.clock()) - gst_element_get_base_time(pipeline_);
}

void Viewer::requested(GstClockTime time) {
  std::optional<uint64_t> applied;
  {
    const std::lock_guard lock(mutex_);
    // The time of a request is a capture time, and the request was sent capture_delay later.
    if (change_ && change_->time <= time + settings_.capture_delay()) {
      applied = change_->id;
      change_.reset();
    }
  }
  if (!applied) return;
  peer_->send(info_message(json{{"applied", {{"id", *applied}, {"rtpTimestamp", rtp_timestamp(time)}}},
                                {"view", view_pipeline_->numbers()}}));
}

void Viewer::control(const std::string& text) {
  {
    const std::lock_guard lock(mutex_);
    if (!messages_.take(g_get_monotonic_time())) {
      refused_messages_++;
      if (!rate_limited_)
        say("view " + std::to_string(settings_.id) + ": messages are ignored, because the viewer sends too many");
      rate_limited_ = true;
      return;
    }
    // The data channel may open before the video starts. Until then, messages with the initial view of a link are
    // queued.
    if (!video_started_) {
      const bool fits = text.size() <= ControlMessage::kMaxBytes;
      if (fits) early_messages_.push_back(text);
      refused_messages_ += !fits;
      return;
    }
  }
  handle_control(text);
}

void Viewer::handle_control(const std::string& text) {
  ControlMessage message = parse_control_message(text, max_aperture_);
  if (!message.error.empty()) refused_messages_++;
  if (message.pixel) send_pixel_info(*message.pixel);
  // Recorded first, because a request with this change may be sent at once.
  std::optional<Change> before;
  if (message.event) {
    const std::lock_guard lock(mutex_);
    before = change_;
    change_ = {*message.id, running_time()};
  }
  if (message.event && !view_pipeline_->send_navigation(message.event.release())) {
    const std::lock_guard lock(mutex_);
    if (change_ && change_->id == *message.id) change_ = before;
  }
  if (message.id) peer_->send(control_response(*message.id, message.error));
}

void Viewer::tick(double busy) {
  busy_ = busy;
  if (connected()) peer_->ask_for_report();
}

void Viewer::update_rig(double max_aperture) {
  max_aperture_ = max_aperture;
  view_pipeline_->set_rig(field_.rig());
  if (connected()) peer_->send(info_message(json{{"rig", field_.array()->hash()}}));
}

void Viewer::shed(const LoadShedding& load_shedding) {
  load_shedding_ = load_shedding;
  apply_quality();
}

void Viewer::apply_quality() {
  set_bit_rate(encoder_, quality_.bits_per_second());
  peer_->set_bit_rate(quality_.bits_per_second());
  // Slightly shorter than a frame, because the times of requests jitter while the view changes.
  const uint64_t period = GST_SECOND / static_cast<uint64_t>(settings_.limits.framerate);
  pacer_.set_interval(static_cast<uint64_t>(pictures_left_out()) * (2 * period - period / 4));
  view_pipeline_->set_depth_interval(load_shedding_.depth_interval());
  const auto side = [this](int full) { return full / size_divisor() & ~1; };
  view_pipeline_->set_size(side(settings_.params.width), side(settings_.params.height));
}

double Viewer::silence(int64_t now) const {
  return static_cast<double>(now - (connected() ? std::max(peer_->last_packet_time(), began_) : began_)) * 1e-6;
}

void Viewer::send_pixel_info(const ControlMessage::Pixel& pixel) {
  auto view = view_pipeline_->asked();
  if (!view) return;
  const bool right = settings_.params.eye_distance > 0 && pixel.x >= view->width;
  if (right) view = offset_view(*view, settings_.params.eye_distance);
  nlohmann::json cameras = field_.array()->pixel(*view, pixel.x - (right ? view->width : 0), pixel.y);
  peer_->send(info_message(json{{"pixel", {{"x", pixel.x}, {"y", pixel.y}, {"cameras", std::move(cameras)}}}}));
}

json Viewer::load_shedding_report() const {
  const bool depth = load_shedding_.depth_interval() > 1, rate = pictures_left_out() > 0, size = size_divisor() > 1;
  const bool processor = depth && (!rate || load_shedding_.pictures_left_out() > 0);
  return {{"what", size    ? "size"
                   : rate  ? "rate"
                   : depth ? "depth"
                           : ""},
          {"why", processor      ? "processor"
                  : rate || size ? "network"
                                 : ""},
          {"depth", depth},
          {"rate", 1 + pictures_left_out()},
          {"size", size_divisor()}};
}

void Viewer::report(const LinkReport& link) {
  if (quality_.update(link.loss, link.round_trip)) apply_quality();
  if (quality_.wants_key_frame())
    gst_element_send_event(encoder_, gst_video_event_new_upstream_force_key_unit(GST_CLOCK_TIME_NONE, TRUE, 0));
  g_autoptr(GstStructure) stats = view_pipeline_->stats();
  const auto ms = [stats](const char* name) { return static_cast<double>(count_in(stats, name)) * 1e-6; };
  json info = {{"pictures", count_in(stats, "pictures")},
               {"incomplete", count_in(stats, "incomplete")},
               {"missing", count_in(stats, "missing-fragments")},
               {"outOfService", count_in(stats, "out-of-service")},
               {"answerBytes", counters().answer_bytes},
               {"skewMs", ms("max-skew-ns")},
               {"answerMs", ms("answer-ns-p50")},
               {"addMs", ms("add-ns-p50")},
               {"pictureMs", ms("latency-ns-p50")},
               {"videoBytes", video_bytes_.load()},
               {"surfaceBytes", surface_bytes_.load()},
               {"bitRate", quality_.bits_per_second()},
               {"frameRate", settings_.limits.framerate / (1 + pictures_left_out())},
               {"sizeDivisor", size_divisor()},
               {"sentRate", 8 * (video_bytes_ - video_bytes_reported_)},
               {"shed", load_shedding_report()},
               {"encoder", encoder_name_},
               {"busy", busy_},
               {"loss", link.loss},
               {"roundTripMs", link.round_trip * 1e3}};
  video_bytes_reported_ = video_bytes_;
  json focus = {{"on", settings_.limits.focus_settings.mode},
                {"rounds", count_in(stats, "focus-rounds")},
                {"interval", count_in(stats, "focus-interval")},
                {"consistencyBytes", count_in(stats, "consistency-bytes")}};
  gdouble residual = 0, gained = 0, near = 0, far = 0;
  gboolean flat = FALSE;
  gst_structure_get(stats, "focus-residual", G_TYPE_DOUBLE, &residual, "focus-improvement", G_TYPE_DOUBLE, &gained,
                    "focus-flat", G_TYPE_BOOLEAN, &flat, "focus-near", G_TYPE_DOUBLE, &near, "focus-far", G_TYPE_DOUBLE,
                    &far, nullptr);
  focus["residual"] = std::isfinite(residual) ? residual : 0;
  focus["gained"] = std::isfinite(gained) ? gained : 0;
  focus["flat"] = flat != FALSE;
  // Sends the depth range of the scene in metres, limited to a range that suits the slider.
  constexpr double kFarthest = 30;
  if (near > 0) {
    focus["near"] = near;
    focus["far"] = std::min(far, kFarthest * near);
  }
  info["focus"] = std::move(focus);
  if (const CameraStates cameras = field_.cameras(); cameras.count > 0)
    info["cameras"] = {{"count", cameras.count}, {"working", cameras.working}};
  if (!field_.is_local()) info["nodes"] = {{"count", field_.nodes()}, {"silent", field_.silent_nodes()}};
  if (json shown = view_pipeline_->shown(); shown.is_object()) info["picture"] = std::move(shown);
  info["monitored"] = settings_.limits.monitor > 0;
  if (const auto view = view_pipeline_->asked()) info["coverage"] = field_.array()->coverage(*view);
  json message = {{"statistics", std::move(info)}};
  if (settings_.params.path.empty()) message["view"] = view_pipeline_->numbers();
  peer_->send(info_message(message));
}

MonitorReport Viewer::monitor() const {
  g_autoptr(GstStructure) stats = view_pipeline_->stats();
  MonitorReport report = monitor_report(stats);
  return report;
}

Viewer::ViewerCounters Viewer::counters() const {
  ViewerCounters counters{.video_bytes = video_bytes_,
                          .surface_bytes = surface_bytes_,
                          .refused_messages = refused_messages_,
                          .bits_per_second = quality_.bits_per_second()};
  g_autoptr(GstStructure) stats = view_pipeline_->stats();
  counters.pictures += count_in(stats, "pictures");
  counters.incomplete += count_in(stats, "incomplete");
  counters.answer_bytes += count_in(stats, "bytes");
  return counters;
}

}  // namespace lf::serve
