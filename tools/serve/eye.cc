// SPDX-License-Identifier: LGPL-2.1-or-later
#include "serve/eye.h"

#include <cmath>
#include <nlohmann/json.hpp>
#include <sstream>

#include "wire/request_codec.h"

namespace lf::serve {
namespace {

// How long a picture waits for what it is made of. Cameras in this process do answer, however busy it is; those of
// other hosts after a round trip. Where all have answered nobody waits.
constexpr GstClockTime kPatience = 500 * GST_MSECOND;

std::optional<ViewRequest> request_in(GstBuffer* buffer) {
  GstMapInfo map;
  if (!gst_buffer_map(buffer, &map, GST_MAP_READ)) return std::nullopt;
  auto request = wire::decode_request({map.data, map.size});
  gst_buffer_unmap(buffer, &map);
  return request;
}

using nlohmann::json;

// missing-cameras to missingCameras.
std::string camel_case(const std::string& name) {
  std::string text;
  for (size_t i = 0; i < name.size(); i++)
    text += name[i] == '-' && i + 1 < name.size() ? g_ascii_toupper(name[++i]) : name[i];
  return text;
}

json json_of(const GstStructure* structure);

json json_of(const GValue* value) {
  if (GST_VALUE_HOLDS_STRUCTURE(value)) return json_of(gst_value_get_structure(value));
  if (G_VALUE_HOLDS_STRING(value)) return g_value_get_string(value);
  if (G_VALUE_HOLDS_BOOLEAN(value)) return g_value_get_boolean(value) != FALSE;
  if (G_VALUE_HOLDS_UINT(value)) return g_value_get_uint(value);
  if (G_VALUE_HOLDS_INT(value)) return g_value_get_int(value);
  if (G_VALUE_HOLDS_UINT64(value)) return g_value_get_uint64(value);
  if (G_VALUE_HOLDS_DOUBLE(value))  // JSON has no infinity
    return std::isfinite(g_value_get_double(value)) ? json(g_value_get_double(value)) : json();
  json array = json::array();
  if (GST_VALUE_HOLDS_ARRAY(value))
    for (guint i = 0; i < gst_value_array_get_size(value); i++)
      array.push_back(json_of(gst_value_array_get_value(value, i)));
  return array;
}

json json_of(const GstStructure* structure) {
  json object = json::object();
  for (gint i = 0; i < gst_structure_n_fields(structure); i++) {
    const gchar* name = gst_structure_nth_field_name(structure, static_cast<guint>(i));
    object[camel_case(name)] = json_of(gst_structure_get_value(structure, name));
  }
  return object;
}

}  // namespace

bool is_probe(GstBuffer* request) {
  uint8_t header[wire::kUnitHeaderBytes] = {};
  gst_buffer_extract(request, 0, header, sizeof header);
  const auto unit = wire::peek_unit(header);
  return !unit || (unit->flags & wire::kProbe);
}

// Between the light field and the encoder the newest picture is the only one that counts. Answers may come as late as
// they like (min-latency: with it an appsrc has no upper bound): where a source allows for less than the requests take
// the compositor has no latency at all, takes itself for one that is not live, and waits for who is gone.
std::string Eye::launch_line(size_t nodes) {
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

Eye::Eye(GstElement* pipeline, LightField& field, const EyeSettings& settings, OnRequest on_request)
    : field_(field), id_(settings.view), on_request_(std::move(on_request)) {
  const auto find = [pipeline](const std::string& name) {
    return gst_bin_get_by_name(GST_BIN(pipeline), name.c_str());
  };
  compositor_ = find("compositor");
  view_ = find("view");
  view_pad_ = gst_element_get_static_pad(view_, "src");
  g_object_set(view_, "rig", field.rig().c_str(), "view-id", id_, "width", settings.width, "height", settings.height,
               "framerate", settings.framerate, 1, "capture-delay", settings.capture_delay, nullptr);
  if (settings.eye_distance > 0) {
    gst_util_set_object_arg(G_OBJECT(view_), "views", "stereo");
    g_object_set(view_, "eye-distance", settings.eye_distance, "converged", FALSE, nullptr);
  }
  g_object_set(compositor_, "rig", field.rig().c_str(), "view-id", id_, "focus-near", settings.focus_on.near,
               "focus-far", settings.focus_on.far, nullptr);
  gst_util_set_object_arg(G_OBJECT(compositor_), "focus", settings.focus_on.mode.c_str());
  if (!settings.focus_on.gains.empty())
    gst_util_set_object_arg(G_OBJECT(compositor_), "gains", settings.focus_on.gains.c_str());
  g_object_set(compositor_, "latency", kPatience, nullptr);
  if (field.is_local()) {
    g_object_set(view_, "quality", 0u, nullptr);  // requests don't leave the process
  }
  if (settings.focus > 0) g_object_set(view_, "focus-distance", settings.focus, nullptr);
  if (!settings.path.empty()) g_object_set(view_, "location", settings.path.c_str(), "loop", TRUE, nullptr);

  GstPad* pictures = gst_element_get_static_pad(compositor_, "src");
  gst_pad_add_probe(pictures, GST_PAD_PROBE_TYPE_BUFFER, note_picture, this, nullptr);
  gst_object_unref(pictures);
  GstElement* requests = find("requests");
  GstAppSinkCallbacks sink_callbacks = {};
  sink_callbacks.new_sample = take_request;
  gst_app_sink_set_callbacks(GST_APP_SINK(requests), &sink_callbacks, this, nullptr);
  gst_object_unref(requests);
  for (size_t i = 0; i < field.nodes(); i++) answers_.push_back(GST_APP_SRC(find("answers" + std::to_string(i))));
  field.join(id_, [this](size_t node, GstBuffer* answer) { take_answer(node, answer); });
}

Eye::~Eye() {
  for (GstAppSrc* source : answers_) gst_object_unref(source);
  gst_object_unref(view_pad_);
  gst_object_unref(view_);
  gst_object_unref(compositor_);
  gst_clear_buffer(&asked_);
  gst_clear_structure(&shown_);
}

void Eye::close() { field_.leave(id_); }

bool Eye::steer(GstEvent* event) { return gst_pad_send_event(view_pad_, event); }

GstStructure* Eye::stats() const {
  GstStructure* stats = nullptr;
  g_object_get(compositor_, "stats", &stats, nullptr);
  return stats;
}

nlohmann::json Eye::numbers() const {
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

GstPadProbeReturn Eye::note_picture(GstPad*, GstPadProbeInfo* info, gpointer data) {
  GstCustomMeta* meta = gst_buffer_get_custom_meta(GST_PAD_PROBE_INFO_BUFFER(info), "lightfield-view");
  if (!meta) return GST_PAD_PROBE_OK;
  Eye* self = static_cast<Eye*>(data);
  GstStructure* shown = gst_structure_copy(gst_custom_meta_get_structure(meta));
  {
    const std::lock_guard lock(self->mutex_);
    std::swap(shown, self->shown_);
  }
  gst_clear_structure(&shown);
  return GST_PAD_PROBE_OK;
}

json Eye::shown() const {
  const std::lock_guard lock(mutex_);
  return shown_ ? json_of(shown_) : json();
}

std::optional<View> Eye::asked() const {
  GstBuffer* request = nullptr;
  {
    const std::lock_guard lock(mutex_);
    if (!asked_) return std::nullopt;
    request = gst_buffer_ref(asked_);
  }
  const auto decoded = request_in(request);
  gst_buffer_unref(request);
  return decoded ? std::optional(decoded->view) : std::nullopt;
}

GstFlowReturn Eye::take_request(GstAppSink* sink, gpointer data) {
  Eye* self = static_cast<Eye*>(data);
  GstSample* sample = gst_app_sink_pull_sample(sink);
  if (!sample) return GST_FLOW_OK;
  GstBuffer* buffer = gst_sample_get_buffer(sample);
  self->field_.request(buffer);
  if (!is_probe(buffer) && self->begins(buffer))
    self->on_request_(
        gst_segment_to_running_time(gst_sample_get_segment(sample), GST_FORMAT_TIME, GST_BUFFER_PTS(buffer)));
  gst_sample_unref(sample);
  return GST_FLOW_OK;
}

// The requests of one picture follow each other, and have one time.
bool Eye::begins(GstBuffer* request) {
  const std::lock_guard lock(mutex_);
  if (asked_ && GST_BUFFER_PTS(asked_) == GST_BUFFER_PTS(request)) return false;
  gst_buffer_replace(&asked_, request);
  return true;
}

void Eye::take_answer(size_t node, GstBuffer* answer) {
  GstBuffer* buffer = gst_buffer_copy(answer);
  GST_BUFFER_PTS(buffer) = GST_CLOCK_TIME_NONE;
  gst_app_src_push_buffer(answers_[node], buffer);
}

}  // namespace lf::serve
