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

constexpr int kMinBitRate = 100000;

uint32_t rtp_timestamp(GstClockTime running_time) {
  return static_cast<uint32_t>(gst_util_uint64_scale_int(running_time, 90000, GST_SECOND));
}

}  // namespace

Viewer::Viewer(LightField& field, Offer offer, const ViewSettings& settings, double max_aperture, const Route& route,
               Callbacks callbacks)
    : BrowserStream(field,
                    ViewerPipeline::launch_line(field.nodes()) + encoder_line(offer.codec, settings.max_bit_rate()) +
                        " ! " + payloader_line(offer),
                    std::move(callbacks)),
      settings_(settings),
      max_aperture_(max_aperture),
      quality_(std::min(kMinBitRate, settings.max_bit_rate()), settings.max_bit_rate(),
               static_cast<double>(settings.params.width) * settings.params.height * settings.limits.framerate),
      messages_(settings.limits.messages_per_second, 2 * settings.limits.messages_per_second) {
  encoder_ = gst_bin_get_by_name(GST_BIN(video_), "encoder");
  encoder_name_ = GST_OBJECT_NAME(gst_element_get_factory(encoder_));
  view_pipeline_ =
      std::make_unique<ViewerPipeline>(video_, field, settings, [this](GstClockTime time) { requested(time); });
  watch_encoder();
  connect(std::move(offer), route, request_base_time(field_.clock(), settings_));
}

void Viewer::start_video() {
  BrowserStream::start_video();
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
  BrowserStream::leave();
}

Viewer::~Viewer() {
  stop();
  view_pipeline_.reset();
  gst_object_unref(encoder_);
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
  if (message.event) is_at_rest_ = false;
  if (message.event && !view_pipeline_->send_navigation(message.event.release())) {
    const std::lock_guard lock(mutex_);
    if (change_ && change_->id == *message.id) change_ = before;
  }
  if (message.id) peer_->send(control_response(*message.id, message.error));
}

void Viewer::update_rig(double max_aperture) {
  max_aperture_ = max_aperture;
  is_at_rest_ = false;
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
  view_pipeline_->reduce(pictures_left_out(), load_shedding_.depth_interval());
  const auto side = [this](int full) { return full / size_divisor() & ~1; };
  view_pipeline_->set_size(side(settings_.params.width), side(settings_.params.height));
}

void Viewer::send_pixel_info(const ControlMessage::Pixel& pixel) {
  auto view = view_pipeline_->asked();
  if (!view) return;
  const bool right = settings_.params.eye_distance > 0 && pixel.x >= view->width;
  if (right) view = offset_view(*view, settings_.params.eye_distance);
  nlohmann::json cameras = field_.array()->pixel(*view, pixel.x - (right ? view->width : 0), pixel.y);
  peer_->send(info_message(json{{"pixel", {{"x", pixel.x}, {"y", pixel.y}, {"cameras", std::move(cameras)}}}}));
}

void Viewer::report(const LinkReport& link) {
  // A busy machine has the time for a single picture in full size.
  if (view_pipeline_->is_resting()) is_at_rest_ = true;
  const bool was_full = std::exchange(is_full_, is_at_rest_.load());
  if (quality_.update(link.loss, link.round_trip) || was_full != is_full_) apply_quality();
  if (quality_.wants_key_frame())
    gst_element_send_event(encoder_, gst_video_event_new_upstream_force_key_unit(GST_CLOCK_TIME_NONE, TRUE, 0));
  json info = view_pipeline_->statistics();
  info.update({{"videoBytes", video_bytes_.load()},
               {"surfaceBytes", surface_bytes_.load()},
               {"bitRate", quality_.bits_per_second()},
               {"frameRate", settings_.limits.framerate / (1 + pictures_left_out())},
               {"sizeDivisor", size_divisor()},
               {"sentRate", 8 * (video_bytes_ - video_bytes_reported_)},
               {"shed", shed_report(load_shedding_, pictures_left_out(), size_divisor())},
               {"encoder", encoder_name_},
               {"busy", busy_},
               {"loss", link.loss},
               {"roundTripMs", link.round_trip * 1e3}});
  video_bytes_reported_ = video_bytes_;
  json message = {{"statistics", std::move(info)}};
  if (settings_.params.path.empty()) message["view"] = view_pipeline_->numbers();
  peer_->send(info_message(message));
}

ViewerCounters Viewer::counters() const {
  ViewerCounters counters = view_pipeline_->counters();
  counters.video_bytes = video_bytes_;
  counters.surface_bytes = surface_bytes_;
  counters.refused_messages = refused_messages_;
  return counters;
}

}  // namespace lf::serve
