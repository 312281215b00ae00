// SPDX-License-Identifier: LGPL-2.1-or-later
#include "serve/viewer_pipeline.h"

#include <cmath>
#include <nlohmann/json.hpp>
#include <sstream>

#include "wire/request_codec.h"

namespace lf::serve {
namespace {

// Maximum time to wait for the answers of a picture, which is complete as soon as all have arrived. Local cameras
// always answer, even on a busy machine. Remote cameras answer after a round trip.
constexpr GstClockTime kPatience = 500 * GST_MSECOND;

std::optional<ViewRequest> request_in(GstBuffer* buffer) {
  GstMapInfo map;
  if (!gst_buffer_map(buffer, &map, GST_MAP_READ)) return std::nullopt;
  auto request = wire::decode_request({map.data, map.size});
  gst_buffer_unmap(buffer, &map);
  return request;
}

// Returns true if the pictures of two requests are equal, provided that the images of the cameras are.
bool has_same_picture(const ViewRequest& a, const ViewRequest& b) {
  return a.view == b.view && a.on_plane == b.on_plane && a.gains.use == b.gains.use && a.rig_hash == b.rig_hash &&
         a.out_of_service == b.out_of_service;
}

using nlohmann::json;

// Maximum number of requests in flight. Over a network, a round trip may take longer than a frame.
constexpr int kMaxLocal = 2, kMaxRemote = 4;

uint64_t count_in(const GstStructure* stats, const char* name) {
  guint64 value = 0;
  gst_structure_get_uint64(stats, name, &value);
  return value;
}

std::string camel_case(const std::string& name) {
  std::string text;
  for (size_t i = 0; i < name.size(); i++)
    text += name[i] == '-' && i + 1 < name.size() ? g_ascii_toupper(name[++i]) : name[i];
  return text;
}

json json_report(const GstStructure* structure);

json json_report(const GValue* value) {
  if (GST_VALUE_HOLDS_STRUCTURE(value)) return json_report(gst_value_get_structure(value));
  if (G_VALUE_HOLDS_STRING(value)) return g_value_get_string(value);
  if (G_VALUE_HOLDS_BOOLEAN(value)) return g_value_get_boolean(value) != FALSE;
  if (G_VALUE_HOLDS_UINT(value)) return g_value_get_uint(value);
  if (G_VALUE_HOLDS_INT(value)) return g_value_get_int(value);
  if (G_VALUE_HOLDS_UINT64(value)) return g_value_get_uint64(value);
  if (G_VALUE_HOLDS_DOUBLE(value)) return g_value_get_double(value);
  json array = json::array();
  if (GST_VALUE_HOLDS_ARRAY(value))
    for (guint i = 0; i < gst_value_array_get_size(value); i++)
      array.push_back(json_report(gst_value_array_get_value(value, i)));
  return array;
}

json json_report(const GstStructure* structure) {
  json object = json::object();
  for (gint i = 0; i < gst_structure_n_fields(structure); i++) {
    const gchar* name = gst_structure_nth_field_name(structure, static_cast<guint>(i));
    if (gst_structure_get_field_type(structure, name) == G_TYPE_BYTES) continue;  // too long for a report
    object[camel_case(name)] = json_report(gst_structure_get_value(structure, name));
  }
  return object;
}

}  // namespace

ViewerCounters& ViewerCounters::operator+=(const ViewerCounters& other) {
  pictures += other.pictures;
  incomplete += other.incomplete;
  answer_bytes += other.answer_bytes;
  video_bytes += other.video_bytes;
  surface_bytes += other.surface_bytes;
  refused_messages += other.refused_messages;
  encoded += other.encoded;
  encoded_half += other.encoded_half;
  return *this;
}

bool is_probe(GstBuffer* request) {
  uint8_t header[wire::kUnitHeaderBytes] = {};
  gst_buffer_extract(request, 0, header, sizeof header);
  const auto unit = wire::peek_unit(header);
  return !unit || (unit->flags & wire::kProbe);
}

json shed_report(const LoadShedding& load_shedding, int left_out, int divisor) {
  const bool depth = load_shedding.depth_interval() > 1, rate = left_out > 0, size = divisor > 1;
  const bool processor = depth && (!rate || load_shedding.pictures_left_out() > 0);
  return {{"what", size    ? "size"
                   : rate  ? "rate"
                   : depth ? "depth"
                           : ""},
          {"why", processor      ? "processor"
                  : rate || size ? "network"
                                 : ""},
          {"depth", depth},
          {"rate", 1 + left_out},
          {"size", divisor}};
}

GstClockTime request_base_time(GstClock* clock, const ViewSettings& settings) {
  const GstClockTime period = GST_SECOND / static_cast<uint64_t>(settings.limits.framerate);
  const GstClockTime now = gst_clock_get_time(clock);
  const auto turn = static_cast<GstClockTime>(request_phase(settings.id) * static_cast<double>(period));
  return now - (now - turn) % period;
}

// Queues between the light field and the encoder are leaky, because only the newest picture matters. Setting
// min-latency gives the appsrcs an unlimited maximum latency. If a source had less maximum latency than the requests,
// the compositor would behave as not live and wait for silent hosts.
std::string ViewerPipeline::launch_line(size_t nodes) {
  std::ostringstream line;
  for (size_t i = 0; i < nodes; i++)
    line << " appsrc name=answers" << i << " is-live=true format=time max-bytes=0 max-buffers=64 "
         << "leaky-type=downstream min-latency=0 caps=application/x-lightfield-answer ! compositor.sink_" << i;
  line << " lfviewrequest name=view is-live=true eager=true ! tee name=r  r. ! appsink name=requests sync=false "
          "async=false enable-last-sample=false  r. ! queue leaky=downstream max-size-buffers=4 ! compositor.request  "
          "lfcompositor name=compositor ! queue leaky=downstream max-size-buffers=1 max-size-bytes=0 max-size-time=0 ! "
          "videoconvert ! video/x-raw,format=I420,colorimetry=bt601 ! ";
  return line.str();
}

ViewerPipeline::ViewerPipeline(GstElement* pipeline, LightField& field, const ViewSettings& settings,
                               OnRequest on_request)
    : field_(field),
      settings_(settings),
      on_request_(std::move(on_request)),
      pacer_(field.is_local() ? kMaxLocal : kMaxRemote) {
  const auto find = [pipeline](const std::string& name) {
    return gst_bin_get_by_name(GST_BIN(pipeline), name.c_str());
  };
  const auto& [id, params, limits] = settings;
  const FocusSettings& focus = limits.focus_settings;
  compositor_ = find("compositor");
  view_ = find("view");
  view_pad_ = gst_element_get_static_pad(view_, "src");
  g_object_set(view_, "rig", field.rig().c_str(), "view-id", id, "width", params.width, "height", params.height,
               "framerate", limits.framerate, 1, "capture-delay", settings.capture_delay(), nullptr);
  if (params.eye_distance > 0) {
    gst_util_set_object_arg(G_OBJECT(view_), "views", "stereo");
    g_object_set(view_, "eye-distance", params.eye_distance, "converged", FALSE, nullptr);
  }
  g_object_set(compositor_, "rig", field.rig().c_str(), "view-id", id, "focus-near", focus.near, "focus-far", focus.far,
               nullptr);
  gst_util_set_object_arg(G_OBJECT(compositor_), "focus", focus.mode.c_str());
  if (!focus.gains.empty()) gst_util_set_object_arg(G_OBJECT(compositor_), "gains", focus.gains.c_str());
  g_object_set(compositor_, "latency", kPatience, nullptr);
  if (field.is_local()) {
    g_object_set(view_, "quality", 0u, nullptr);  // 0: no compression, because local answers stay in this process
  }
  if (limits.focus > 0) g_object_set(view_, "focus-distance", limits.focus, nullptr);
  if (!params.path.empty()) g_object_set(view_, "location", params.path.c_str(), "loop", TRUE, nullptr);

  g_autoptr(GstPad) pictures = gst_element_get_static_pad(compositor_, "src");
  gst_pad_add_probe(pictures, GST_PAD_PROBE_TYPE_BUFFER, on_picture, this, nullptr);
  g_autoptr(GstElement) requests = find("requests");
  GstAppSinkCallbacks sink_callbacks = {};
  sink_callbacks.new_sample = take_request;
  gst_app_sink_set_callbacks(GST_APP_SINK(requests), &sink_callbacks, this, nullptr);
  for (size_t i = 0; i < field.nodes(); i++) answers_.push_back(GST_APP_SRC(find("answers" + std::to_string(i))));
  pace_requests();
  field.join(id, [this](size_t node, GstBuffer* answer) { take_answer(node, answer); });
}

ViewerPipeline::~ViewerPipeline() {
  for (GstAppSrc* source : answers_) gst_object_unref(source);
  gst_object_unref(view_pad_);
  gst_object_unref(view_);
  gst_object_unref(compositor_);
  gst_clear_buffer(&last_request_);
  gst_clear_structure(&picture_fields_);
}

void ViewerPipeline::close() { field_.leave(settings_.id); }

void ViewerPipeline::pace_requests() {
  const auto skips = +[](GstElement*, guint64 time, gpointer data) -> gboolean {
    return !static_cast<RequestPacer*>(data)->begin(time);
  };
  g_signal_connect(view_, "skip-request", G_CALLBACK(skips), &pacer_);
  g_autoptr(GstPad) pictures = gst_element_get_static_pad(compositor_, "src");
  gst_pad_add_probe(
      pictures, GST_PAD_PROBE_TYPE_BUFFER,
      [](GstPad*, GstPadProbeInfo* info, gpointer data) {
        static_cast<RequestPacer*>(data)->end(GST_BUFFER_PTS(GST_PAD_PROBE_INFO_BUFFER(info)));
        return GST_PAD_PROBE_OK;
      },
      &pacer_, nullptr);
}

void ViewerPipeline::reduce(int left_out, unsigned depth_interval) {
  // Slightly shorter than a frame, because the times of requests jitter while the view changes.
  const uint64_t period = GST_SECOND / static_cast<uint64_t>(settings_.limits.framerate);
  pacer_.set_interval(static_cast<uint64_t>(left_out) * (2 * period - period / 4));
  g_object_set(compositor_, "depth-interval", depth_interval, nullptr);
}

bool ViewerPipeline::send_navigation(GstEvent* event) {
  pacer_.note_repeat(false);
  return gst_pad_send_event(view_pad_, event);
}

GstStructure* ViewerPipeline::stats() const {
  GstStructure* stats = nullptr;
  g_object_get(compositor_, "stats", &stats, nullptr);
  return stats;
}

ViewerCounters ViewerPipeline::counters() const {
  g_autoptr(GstStructure) stats = this->stats();
  return {.pictures = count_in(stats, "pictures"),
          .incomplete = count_in(stats, "incomplete"),
          .answer_bytes = count_in(stats, "bytes")};
}

MonitorReport ViewerPipeline::monitor() const {
  g_autoptr(GstStructure) stats = this->stats();
  return monitor_report(stats);
}

json ViewerPipeline::statistics() const {
  g_autoptr(GstStructure) stats = this->stats();
  const auto ms = [&stats](const char* name) { return static_cast<double>(count_in(stats, name)) * 1e-6; };
  json info = {{"pictures", count_in(stats, "pictures")},
               {"incomplete", count_in(stats, "incomplete")},
               {"missing", count_in(stats, "missing-fragments")},
               {"outOfService", count_in(stats, "out-of-service")},
               {"answerBytes", count_in(stats, "bytes")},
               {"skewMs", ms("max-skew-ns")},
               {"answerMs", ms("answer-ns-p50")},
               {"addMs", ms("add-ns-p50")},
               {"pictureMs", ms("latency-ns-p50")}};
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
  if (json shown = this->shown(); shown.is_object()) info["picture"] = std::move(shown);
  info["unit"] = field_.array()->unit();
  info["monitored"] = settings_.limits.monitor > 0;
  if (const auto view = asked()) info["coverage"] = field_.array()->coverage(*view);
  return info;
}

nlohmann::json ViewerPipeline::numbers() const {
  nlohmann::json view = nlohmann::json::object();
  guint count = 0;
  g_autofree GParamSpec** specs = g_object_class_list_properties(G_OBJECT_GET_CLASS(view_), &count);
  for (guint i = 0; i < count; i++) {
    if (!G_IS_PARAM_SPEC_DOUBLE(specs[i]) || !(specs[i]->flags & GST_PARAM_CONTROLLABLE)) continue;
    gdouble value = 0;
    g_object_get(view_, specs[i]->name, &value, nullptr);
    view[specs[i]->name] = value;
  }
  return view;
}

GstPadProbeReturn ViewerPipeline::on_picture(GstPad*, GstPadProbeInfo* info, gpointer data) {
  GstCustomMeta* meta = gst_buffer_get_custom_meta(GST_PAD_PROBE_INFO_BUFFER(info), "lightfield-view");
  if (!meta) return GST_PAD_PROBE_OK;
  ViewerPipeline* self = static_cast<ViewerPipeline*>(data);
  const GstClockTime now = gst_element_get_current_running_time(self->compositor_);
  const GstClockTime captured = GST_BUFFER_PTS(GST_PAD_PROBE_INFO_BUFFER(info));
  if (GST_CLOCK_TIME_IS_VALID(now) && GST_CLOCK_TIME_IS_VALID(captured))
    self->field_.picture_ages().add(static_cast<double>(GST_CLOCK_DIFF(captured, now)) * 1e-9);
  GstStructure* shown = gst_structure_copy(gst_custom_meta_get_structure(meta));
  {
    const std::lock_guard lock(self->mutex_);
    std::swap(shown, self->picture_fields_);
  }
  gst_clear_structure(&shown);
  return GST_PAD_PROBE_OK;
}

json ViewerPipeline::shown() const {
  const std::lock_guard lock(mutex_);
  return picture_fields_ ? json_report(picture_fields_) : json();
}

std::optional<View> ViewerPipeline::asked() const {
  g_autoptr(GstBuffer) request = nullptr;
  {
    const std::lock_guard lock(mutex_);
    if (!last_request_) return std::nullopt;
    request = gst_buffer_ref(last_request_);
  }
  const auto decoded = request_in(request);
  return decoded ? std::optional(decoded->view) : std::nullopt;
}

GstFlowReturn ViewerPipeline::take_request(GstAppSink* sink, gpointer data) {
  ViewerPipeline* self = static_cast<ViewerPipeline*>(data);
  g_autoptr(GstSample) sample = gst_app_sink_pull_sample(sink);
  if (!sample) return GST_FLOW_OK;
  GstBuffer* buffer = gst_sample_get_buffer(sample);
  self->field_.request(buffer);
  if (!is_probe(buffer) && self->begins(buffer))
    self->on_request_(
        gst_segment_to_running_time(gst_sample_get_segment(sample), GST_FORMAT_TIME, GST_BUFFER_PTS(buffer)));
  return GST_FLOW_OK;
}

// All requests of one picture are consecutive and have the same time.
bool ViewerPipeline::begins(GstBuffer* request) {
  {
    const std::lock_guard lock(mutex_);
    if (last_request_ && GST_BUFFER_PTS(last_request_) == GST_BUFFER_PTS(request)) return false;
    gst_buffer_replace(&last_request_, request);
  }
  std::optional<ViewRequest> decoded = field_.is_still() ? request_in(request) : std::nullopt;
  pacer_.note_repeat(decoded && last_shown_ && has_same_picture(*decoded, *last_shown_));
  last_shown_ = std::move(decoded);
  return true;
}

void ViewerPipeline::take_answer(size_t node, GstBuffer* answer) {
  GstBuffer* buffer = gst_buffer_copy(answer);
  GST_BUFFER_PTS(buffer) = GST_CLOCK_TIME_NONE;
  gst_app_src_push_buffer(answers_[node], buffer);
}

}  // namespace lf::serve
