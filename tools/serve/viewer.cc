// SPDX-License-Identifier: LGPL-2.1-or-later
#include "viewer.h"

#include <cstdio>
#include <nlohmann/json.hpp>
#include <sstream>

#include "encoder.h"
#include "launch.h"
#include "wire/request_codec.h"

namespace lf::serve {
namespace {

using nlohmann::json;

// Requests of a viewer that are under way. Over a network a round trip may be longer than a frame.
constexpr int kMostLocal = 2, kMostRemote = 4;
// Cameras in this process do answer, however busy it is.
constexpr GstClockTime kLocalPatience = 500 * GST_MSECOND;

// Between the light field and the encoder the newest picture is the only one that counts.
std::string launch_line(const Offer& offer, size_t nodes, const ViewerSettings& settings) {
  std::ostringstream line;
  line << "lfviewrequest name=view is-live=true eager=true ! tee name=r  r. ! appsink name=requests sync=false async=false "
          "enable-last-sample=false  r. ! queue leaky=downstream max-size-buffers=2 ! c.request "
          "lfcompositor name=c ! queue leaky=downstream max-size-buffers=1 max-size-bytes=0 max-size-time=0 ! "
          "videoconvert ! video/x-raw,format=I420,colorimetry=bt601 ! "
       << encoder_line(offer, settings.most_bit_rate) << " ! webrtcbin name=webrtc bundle-policy=max-bundle";
  for (size_t i = 0; i < nodes; i++)
    line << " appsrc name=answers" << i << " is-live=true format=time max-bytes=0 max-buffers=64 leaky-type=downstream "
         << "caps=application/x-lightfield-answer ! c.sink_" << i;
  return line.str();
}

uint64_t count_in(const GstStructure* stats, const char* name) {
  guint64 value = 0;
  gst_structure_get_uint64(stats, name, &value);
  return value;
}

// The numbers of the view, as the properties of lfviewrequest.
json view_of(GstElement* element) {
  json view = json::object();
  guint count = 0;
  g_autofree GParamSpec** specs = g_object_class_list_properties(G_OBJECT_GET_CLASS(element), &count);
  for (guint i = 0; i < count; i++) {
    if (!G_IS_PARAM_SPEC_DOUBLE(specs[i])) continue;
    gdouble value = 0;
    g_object_get(element, specs[i]->name, &value, nullptr);
    view[specs[i]->name] = value;
  }
  return view;
}

std::optional<View> view_in(GstBuffer* request) {
  GstMapInfo map;
  if (!gst_buffer_map(request, &map, GST_MAP_READ)) return std::nullopt;
  const auto decoded = wire::decode_request({map.data, map.size});
  gst_buffer_unmap(request, &map);
  return decoded ? std::optional(decoded->view) : std::nullopt;
}

std::string info_message(const json& info) {
  return json{{"type", "InfoMessage"}, {"mid", "video0"}, {"info", info}}.dump();
}

}  // namespace

Viewer::Viewer(LightField& field, Offer offer, const ViewerSettings& settings, Callbacks callbacks)
    : field_(field),
      settings_(settings),
      callbacks_(std::move(callbacks)),
      began_(g_get_monotonic_time()),
      pace_(field.is_local() ? kMostLocal : kMostRemote),
      quality_(settings.least_bit_rate, settings.most_bit_rate),
      messages_(settings.messages_per_second, 2 * settings.messages_per_second) {
  pipeline_ = launch_pipeline(launch_line(offer, field.nodes(), settings));
  const auto find = [this](const std::string& name) { return gst_bin_get_by_name(GST_BIN(pipeline_), name.c_str()); };
  set_in(pipeline_, "view", "rig", field.rig().c_str(), "view-id", settings.view, "width", settings.width, "height",
         settings.height, "framerate", settings.framerate, 1, "capture-delay", settings.capture_delay);
  set_in(pipeline_, "c", "rig", field.rig().c_str(), "view-id", settings.view);
  if (field.is_local()) set_in(pipeline_, "c", "latency", kLocalPatience);
  if (settings.focus > 0) set_in(pipeline_, "view", "focus-distance", settings.focus);
  compositor_ = find("c");
  encoder_ = find("encoder");
  view_ = find("view");
  view_pad_ = gst_element_get_static_pad(view_, "src");

  watch_pace();
  GstElement* requests = find("requests");
  GstAppSinkCallbacks sink_callbacks = {};
  sink_callbacks.new_sample = take_request;
  gst_app_sink_set_callbacks(GST_APP_SINK(requests), &sink_callbacks, this, nullptr);
  gst_object_unref(requests);
  for (size_t i = 0; i < field.nodes(); i++) answers_.push_back(GST_APP_SRC(find("answers" + std::to_string(i))));

  GstElement* payloader = find("payloader");
  GstPad* out = gst_element_get_static_pad(payloader, "src");
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
  gst_object_unref(out);
  gst_object_unref(payloader);

  GstElement* webrtc = find("webrtc");
  peer_ = Peer::make(webrtc, std::move(offer), settings.address,
                     {[this](const std::string& sdp) {
                        answered_ = g_get_monotonic_time();
                        callbacks_.on_answer(sdp);
                      },
                      callbacks_.on_gone, [this](const std::string& text) { control(text); },
                      [this](const LinkReport& link) { report(link); }});
  gst_object_unref(webrtc);

  GstBus* bus = gst_element_get_bus(pipeline_);
  watch_ = gst_bus_add_watch(bus, bus_message, this);
  gst_object_unref(bus);
  gst_pipeline_use_clock(GST_PIPELINE(pipeline_), field.clock());
  field.join(settings.view, [this](size_t node, GstBuffer* answer) { take_answer(node, answer); });
  gst_element_set_state(pipeline_, GST_STATE_PLAYING);
}

void Viewer::watch_pace() {
  gst_pad_add_probe(
      view_pad_, GST_PAD_PROBE_TYPE_BUFFER,
      [](GstPad*, GstPadProbeInfo* info, gpointer data) {
        const GstClockTime time = GST_BUFFER_PTS(GST_PAD_PROBE_INFO_BUFFER(info));
        return static_cast<Pace*>(data)->begin(time) ? GST_PAD_PROBE_OK : GST_PAD_PROBE_DROP;
      },
      &pace_, nullptr);
  GstPad* pictures = gst_element_get_static_pad(compositor_, "src");
  gst_pad_add_probe(
      pictures, GST_PAD_PROBE_TYPE_BUFFER,
      [](GstPad*, GstPadProbeInfo* info, gpointer data) {
        static_cast<Pace*>(data)->end(GST_BUFFER_PTS(GST_PAD_PROBE_INFO_BUFFER(info)));
        return GST_PAD_PROBE_OK;
      },
      &pace_, nullptr);
  gst_object_unref(pictures);
}

Viewer::~Viewer() {
  field_.leave(settings_.view);
  g_source_remove(watch_);
  gst_element_set_state(pipeline_, GST_STATE_NULL);
  peer_.reset();
  for (GstAppSrc* source : answers_) gst_object_unref(source);
  gst_object_unref(view_pad_);
  gst_object_unref(view_);
  gst_object_unref(compositor_);
  gst_object_unref(encoder_);
  gst_object_unref(pipeline_);
}

// A browser that goes makes an error of its own pipeline: it is a departure.
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

GstFlowReturn Viewer::take_request(GstAppSink* sink, gpointer data) {
  Viewer* self = static_cast<Viewer*>(data);
  GstSample* sample = gst_app_sink_pull_sample(sink);
  if (!sample) return GST_FLOW_OK;
  GstBuffer* buffer = gst_sample_get_buffer(sample);
  self->field_.request(buffer);
  const guint64 time =
      gst_segment_to_running_time(gst_sample_get_segment(sample), GST_FORMAT_TIME, GST_BUFFER_PTS(buffer));
  std::optional<uint64_t> applied;
  {
    const std::lock_guard lock(self->mutex_);
    if (auto asked = view_in(buffer)) self->asked_ = std::move(asked);
    if (self->change_ && self->change_->time <= time) {
      applied = self->change_->id;
      self->change_.reset();
    }
  }
  if (applied) {
    const auto stamp = static_cast<uint32_t>(gst_util_uint64_scale_int(time, 90000, GST_SECOND));
    self->peer_->send(
        info_message({{"applied", {{"id", *applied}, {"rtpTimestamp", stamp}}}, {"view", view_of(self->view_)}}));
  }
  gst_sample_unref(sample);
  return GST_FLOW_OK;
}

void Viewer::take_answer(size_t node, GstBuffer* answer) {
  GstBuffer* buffer = gst_buffer_copy(answer);
  GST_BUFFER_PTS(buffer) = GST_CLOCK_TIME_NONE;
  gst_app_src_push_buffer(answers_[node], buffer);
}

void Viewer::control(const std::string& text) {
  {
    const std::lock_guard lock(mutex_);
    if (!messages_.take(g_get_monotonic_time())) {
      refused_messages_++;
      if (!flooded_) std::printf("view %u: too many messages\n", settings_.view);
      flooded_ = true;
      return;
    }
  }
  ControlMessage message = parse_control_message(text);
  if (!message.error.empty()) refused_messages_++;
  if (message.pixel) tell_pixel(*message.pixel);
  // Noted before, because a request that has the change may leave at once.
  std::optional<Change> before;
  if (message.event) {
    const std::lock_guard lock(mutex_);
    before = change_;
    change_ = {*message.id, running_time()};
  }
  // That a key or a movement means nothing here is no error.
  if (message.event && !gst_pad_send_event(view_pad_, message.event.release())) {
    const std::lock_guard lock(mutex_);
    if (change_ && change_->id == *message.id) change_ = before;
  }
  if (message.id) peer_->send(control_response(*message.id, message.error));
}

std::optional<View> Viewer::asked() {
  const std::lock_guard lock(mutex_);
  return asked_;
}

void Viewer::tell_pixel(const ControlMessage::Pixel& pixel) {
  if (const auto view = asked())
    peer_->send(info_message(
        {{"pixel", {{"x", pixel.x}, {"y", pixel.y}, {"cameras", field_.array().pixel(*view, pixel.x, pixel.y)}}}}));
}

void Viewer::tick() {
  if (connected()) peer_->ask_for_report();
}

void Viewer::report(const LinkReport& link) {
  if (quality_.update(link.loss, link.round_trip)) set_bit_rate(encoder_, quality_.bits_per_second());
  GstStructure* stats = nullptr;
  g_object_get(compositor_, "stats", &stats, nullptr);
  const auto ms = [stats](const char* name) { return static_cast<double>(count_in(stats, name)) * 1e-6; };
  json info = {{"pictures", count_in(stats, "pictures")},
               {"incomplete", count_in(stats, "incomplete")},
               {"missing", count_in(stats, "missing-fragments")},
               {"outOfService", count_in(stats, "out-of-service")},
               {"answerBytes", count_in(stats, "bytes")},
               {"skewMs", ms("max-skew-ns")},
               {"answerMs", ms("answer-ns-p50")},
               {"addMs", ms("add-ns-p50")},
               {"pictureMs", ms("latency-ns-p50")},
               {"videoBytes", video_bytes_.load()},
               {"bitRate", quality_.bits_per_second()},
               {"loss", link.loss},
               {"roundTripMs", link.round_trip * 1e3}};
  gst_structure_free(stats);
  if (const auto view = asked()) info["coverage"] = field_.array().coverage(*view);
  peer_->send(info_message({{"statistics", std::move(info)}, {"view", view_of(view_)}}));
}

double Viewer::silence(int64_t now) const {
  return static_cast<double>(now - std::max(peer_->heard(), answered_ ? answered_ : began_)) * 1e-6;
}

Viewer::Figures Viewer::figures() const {
  GstStructure* stats = nullptr;
  g_object_get(compositor_, "stats", &stats, nullptr);
  const Figures figures{count_in(stats, "pictures"), count_in(stats, "incomplete"),
                        count_in(stats, "bytes"),    video_bytes_,
                        refused_messages_,           quality_.bits_per_second()};
  gst_structure_free(stats);
  return figures;
}

}  // namespace lf::serve
