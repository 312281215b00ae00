// SPDX-License-Identifier: LGPL-2.1-or-later
#include "serve/light_field.h"

#include <algorithm>
#include <nlohmann/json.hpp>
#include <optional>
#include <sstream>

#include "base/text.h"
#include "common/wall_clock.h"
#include "rig/source_security.h"
#include "serve/pipelines.h"
#include "serve/process.h"

namespace lf::serve {
namespace {

constexpr char kRequestCaps[] = "application/x-lightfield-request,framerate=(fraction)0/1";

double now() { return static_cast<double>(g_get_monotonic_time()) * 1e-6; }

std::string launch_line(size_t hosts, const std::string& resampling, const std::string& renderer) {
  std::ostringstream line;
  line << "appsrc name=requests is-live=true format=time do-timestamp=true leaky-type=downstream max-bytes=0 caps=\""
       << kRequestCaps << '"';
  // Answers are not compressed, because local answers stay in this process.
  if (hosts == 0)
    line << " ! lfcameranode name=cameras is-live=true loop=true codec=raw16 resampling=" << resampling
         << " renderer=" << renderer << " !";
  for (size_t i = 0; i < std::max<size_t>(hosts, 1); i++)
    line << " appsink name=answers" << i << " sync=false async=false enable-last-sample=false";
  return line.str();
}

void link(GstElement* from, GstElement* to) {
  if (!gst_element_link(from, to))
    throw Error(std::string(GST_OBJECT_NAME(from)) + " cannot be linked with " + GST_OBJECT_NAME(to));
}

void log_camera_message(const std::string& text) { say(text.starts_with("cameras") ? text : "cameras: " + text); }

GstElement* child_of(const ElementPtr& pipeline, const std::string& name) {
  return ElementPtr(gst_bin_get_by_name(GST_BIN(pipeline.get()), name.c_str())).get();
}

}  // namespace

LightField::LightField(const std::string& rig, const std::vector<NodeAddress>& nodes, const std::string& key_file,
                       const std::string& resampling, const std::string& renderer, const std::string& record,
                       int max_views, bool trusted)
    : local_(nodes.empty()), trusted_(trusted) {
  array_ = std::make_shared<const ArrayInfo>(rig);
  if (local_) require_trust(array_->rig(), rig, trusted_);
  mosaic_ = std::make_shared<cameras::Mosaic>(array_->rig());
  pipeline_.reset(GST_ELEMENT(gst_object_ref_sink(launch(launch_line(nodes.size(), resampling, renderer), false))));
  requests_ = GST_APP_SRC(child_of(pipeline_, "requests"));
  gst_app_src_set_max_buffers(requests_, static_cast<guint64>(2 * max_views + 2));
  if (local_) {
    node_ = child_of(pipeline_, "cameras");
    g_object_set(node_, "rig", rig.c_str(), "trusted", static_cast<gboolean>(trusted), nullptr);
    if (!record.empty()) g_object_set(node_, "record", record.c_str(), nullptr);
    // twice the maximum, because viewers that have left still count for a while
    g_autoptr(GstStructure) limits =
        gst_structure_new("limits", "max-views", G_TYPE_UINT, static_cast<guint>(2 * max_views), nullptr);
    g_object_set(node_, "limits", limits, nullptr);
    g_signal_connect(node_, "element-added", G_CALLBACK(camera_added), this);
  } else {
    hosts_ = std::make_unique<CameraHosts>(GST_BIN(pipeline_.get()), nodes, key_file);
    link(GST_ELEMENT(requests_), hosts_->requests());
  }
  for (size_t i = 0; i < std::max<size_t>(nodes.size(), 1); i++) {
    answers_.push_back(std::make_unique<Answers>());
    answers_[i]->field = this;
    answers_[i]->node = i;
    GstElement* sink = child_of(pipeline_, "answers" + std::to_string(i));
    if (hosts_) link(hosts_->hosts()[i].answers, sink);
    GstAppSinkCallbacks callbacks = {};
    callbacks.new_sample = take_answer;
    gst_app_sink_set_callbacks(GST_APP_SINK(sink), &callbacks, answers_[i].get(), nullptr);
  }
  // Requests state capture times as wall-clock time, which all hosts share.
  clock_ = new_wall_clock();
  gst_pipeline_use_clock(GST_PIPELINE(pipeline_.get()), clock_);
}

LightField::~LightField() {
  if (watch_) g_source_remove(watch_);
  gst_element_set_state(pipeline_.get(), GST_STATE_NULL);
  gst_object_unref(clock_);
}

void LightField::start(std::function<void(const std::string&)> on_error) {
  const GstStateChangeReturn result = play();
  GstBus* bus = gst_element_get_bus(pipeline_.get());
  constexpr auto kWorthTelling = GstMessageType(GST_MESSAGE_ERROR | GST_MESSAGE_WARNING);
  while (GstMessage* message = gst_bus_pop_filtered(bus, kWorthTelling)) {
    message = with_port(message);
    const std::string text = text_of(message);
    const bool is_error = GST_MESSAGE_TYPE(message) == GST_MESSAGE_ERROR;
    gst_message_unref(message);
    if (!is_error) {
      log_camera_message(text);
      continue;
    }
    gst_object_unref(bus);
    throw Error(text);
  }
  on_error_ = std::move(on_error);
  gst_bus_set_sync_handler(bus, bus_sync, this, nullptr);
  watch_ = gst_bus_add_watch(bus, bus_message, this);
  gst_object_unref(bus);
  if (result == GST_STATE_CHANGE_FAILURE || result == GST_STATE_CHANGE_ASYNC)
    throw Error(rig() + ": the cameras could not be started");
}

// Short waits, so that cancel() takes effect soon.
GstStateChangeReturn LightField::play() {
  constexpr GstClockTime kStep = 100 * GST_MSECOND, kLongest = 60 * GST_SECOND;
  gst_element_set_state(pipeline_.get(), GST_STATE_PLAYING);
  GstStateChangeReturn result = GST_STATE_CHANGE_ASYNC;
  for (GstClockTime waited = 0; result == GST_STATE_CHANGE_ASYNC && waited < kLongest && !cancelled_; waited += kStep)
    result = gst_element_get_state(pipeline_.get(), nullptr, nullptr, kStep);
  return result;
}

std::shared_ptr<const ArrayInfo> LightField::array() const {
  const std::lock_guard lock(mutex_);
  return array_;
}

bool LightField::has_cameras_of(const ArrayInfo& array) const {
  if (!local_) return true;
  const std::shared_ptr<const ArrayInfo> now = this->array();
  const auto same = [](const Camera& a, const Camera& b) {
    return a.id == b.id && a.source == b.source && a.image == b.image && a.width == b.width && a.height == b.height;
  };
  const std::lock_guard lock(mutex_);
  return problem_.empty() && std::ranges::equal(now->rig().cameras, array.rig().cameras, same);
}

void LightField::update_rig(std::shared_ptr<const ArrayInfo> array) {
  if (node_) g_object_set(node_, "rig", array->path().c_str(), nullptr);
  const std::lock_guard lock(mutex_);
  if (array->rig().cameras.size() != array_->rig().cameras.size() || array->hash() != array_->hash())
    mosaic_ = std::make_shared<cameras::Mosaic>(array->rig());
  array_ = std::move(array);
}

void LightField::restart(std::shared_ptr<const ArrayInfo> array) {
  if (local_) require_trust(array->rig(), array->path(), trusted_);
  restarting_ = true;
  {
    const std::lock_guard lock(mutex_);
    problem_.clear();
  }
  gst_element_set_state(pipeline_.get(), GST_STATE_NULL);
  update_rig(std::move(array));
  const GstStateChangeReturn result = play();
  std::unique_lock lock(mutex_);
  if ((result == GST_STATE_CHANGE_FAILURE || result == GST_STATE_CHANGE_ASYNC) && problem_.empty())
    problem_ = array_->path() + ": the cameras could not be started";
  const std::string problem = problem_;
  lock.unlock();
  if (!problem.empty()) gst_element_set_state(pipeline_.get(), GST_STATE_NULL);
  restarting_ = false;
  if (!problem.empty()) throw Error(problem);
}

// restart() reports errors that occur meanwhile
GstBusSyncReply LightField::bus_sync(GstBus*, GstMessage* message, gpointer data) {
  LightField* self = static_cast<LightField*>(data);
  if (GST_MESSAGE_TYPE(message) != GST_MESSAGE_ERROR || !self->restarting_) return GST_BUS_PASS;
  const std::lock_guard lock(self->mutex_);
  self->problem_ = text_of(message);
  gst_message_unref(message);
  return GST_BUS_DROP;
}

gboolean LightField::bus_message(GstBus*, GstMessage* message, gpointer data) {
  LightField* self = static_cast<LightField*>(data);
  if (GST_MESSAGE_TYPE(message) == GST_MESSAGE_ERROR)
    self->on_error_(text_of(message));
  else if (GST_MESSAGE_TYPE(message) == GST_MESSAGE_WARNING)
    log_camera_message(text_of(message));
  else if (gst_message_has_name(message, "lightfield-camera-found"))
    say(std::string("cameras: ") + GST_OBJECT_NAME(GST_MESSAGE_SRC(message)) + " is back");
  return G_SOURCE_CONTINUE;
}

// lfcameranode creates new cameras at every start.
void LightField::camera_added(GstBin*, GstElement* child, gpointer data) {
  GstElementFactory* factory = gst_element_get_factory(child);
  if (!factory || !g_str_equal(GST_OBJECT_NAME(factory), "lfcamsrc")) return;
  struct Tap {
    LightField* field;
    GstElement* camera;  // outlives its pad
  };
  g_autoptr(GstPad) pad = gst_element_get_static_pad(child, "src");
  gst_pad_add_probe(
      pad, GST_PAD_PROBE_TYPE_BUFFER,
      [](GstPad* pad, GstPadProbeInfo* info, gpointer data) {
        const auto* tap = static_cast<Tap*>(data);
        guint id = 0;
        g_object_get(tap->camera, "camera", &id, nullptr);
        g_autoptr(GstCaps) caps = gst_pad_get_current_caps(pad);
        if (caps) tap->field->mosaic()->see(id, GST_PAD_PROBE_INFO_BUFFER(info), caps, now());
        return GST_PAD_PROBE_OK;
      },
      new Tap{static_cast<LightField*>(data), child}, [](gpointer tap) { delete static_cast<Tap*>(tap); });
}

std::shared_ptr<cameras::Mosaic> LightField::mosaic() const {
  const std::lock_guard lock(mutex_);
  return mosaic_;
}

std::vector<uint8_t> LightField::mosaic_jpeg() {
  if (!local_) throw Error("the cameras are on other hosts, so this server has no thumbnails");
  return mosaic()->jpeg(now());
}

std::string LightField::mosaic_state() {
  if (!local_) throw Error("the cameras are on other hosts, so this server has no thumbnails");
  constexpr double kEvery = 0.1;  // seconds between updates, which are rare because each visits all cameras
  const std::lock_guard lock(state_mutex_);
  const double time = now();
  if (time - state_at_ < kEvery) return state_;
  state_ = mosaic()->state(time, [this](uint32_t camera) { return camera_problem(node_, camera); }).dump();
  state_at_ = time;
  return state_;
}

void LightField::update_camera_states() {
  if (node_) states_ = camera_states(node_);
}

void LightField::join(uint32_t view, OnAnswer on_answer) {
  const std::lock_guard lock(mutex_);
  views_[view] = std::move(on_answer);
}

void LightField::leave(uint32_t view) {
  const std::lock_guard lock(mutex_);
  views_.erase(view);
}

std::vector<size_t> LightField::silent_nodes() const {
  const int64_t now = g_get_monotonic_time();
  std::vector<size_t> silent;
  if (local_ || now - last_request_ > kSilence) return silent;
  for (const auto& answers : answers_)
    if (now - std::max<int64_t>(answers->last_answer_time, active_since_) > kSilence) silent.push_back(answers->node);
  return silent;
}

void LightField::request(GstBuffer* request) {
  const int64_t now = g_get_monotonic_time();
  if (now - last_request_.exchange(now) > kSilence) active_since_ = now;
  // The timestamps refer to the viewer's pipeline and mean nothing in this pipeline.
  GstBuffer* buffer = gst_buffer_copy(request);
  GST_BUFFER_PTS(buffer) = GST_CLOCK_TIME_NONE;
  gst_app_src_push_buffer(requests_, buffer);
}

GstFlowReturn LightField::take_answer(GstAppSink* sink, gpointer data) {
  Answers* answers = static_cast<Answers*>(data);
  LightField* self = answers->field;
  answers->last_answer_time = g_get_monotonic_time();
  g_autoptr(GstSample) sample = gst_app_sink_pull_sample(sink);
  if (!sample) return GST_FLOW_OK;
  GstBuffer* buffer = gst_sample_get_buffer(sample);
  if (const auto view = buffer ? view_of(buffer) : std::nullopt) {
    self->bytes_ += gst_buffer_get_size(buffer);
    const std::lock_guard lock(self->mutex_);
    if (const auto found = self->views_.find(*view); found != self->views_.end()) found->second(answers->node, buffer);
  }
  return GST_FLOW_OK;
}

}  // namespace lf::serve
