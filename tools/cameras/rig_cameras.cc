// SPDX-License-Identifier: LGPL-2.1-or-later
#include "cameras/rig_cameras.h"

#include <gst/app/gstappsink.h>

#include <algorithm>
#include <utility>

#include "base/error.h"

namespace lf::cameras {
namespace {

constexpr char kCaptureTime[] = "timestamp/x-lightfield-capture";
constexpr GstClockTime kStep = GST_SECOND / 20;

GstElement* make(const char* factory) {
  GstElement* element = gst_element_factory_make(factory, nullptr);
  if (!element) throw Error(std::string("element ") + factory + " is not installed");
  return element;
}

double seconds(GstClockTime time) { return static_cast<double>(time) / GST_SECOND; }

// In words, of the caps of what a source gives.
std::string format_of(GstPad* pad) {
  GstCaps* caps = gst_pad_get_current_caps(pad);
  if (!caps) return "";
  const GstStructure* structure = gst_caps_get_structure(caps, 0);
  const std::string name = gst_structure_get_name(structure);
  std::string format;
  if (const char* raw = gst_structure_get_string(structure, "format"); name == "video/x-raw" && raw) format = raw;
  if (const char* coding = gst_structure_get_string(structure, "encoding-name"))
    format = std::string(coding) + " by RTP";
  if (name == "image/jpeg") format = "JPEG";
  if (name == "video/x-h264") format = "H264";
  if (name == "video/x-h265") format = "H265";
  if (name == "video/x-bayer") format = "Bayer";
  gst_caps_unref(caps);
  return format;
}

}  // namespace

// A camera that is open.
struct RigCameras::One {
  RigCameras* cameras = nullptr;
  CameraIndex index = 0;
  GstElement* source = nullptr;  // lfcamsrc, of the pipeline
  std::atomic<uint64_t> frames = 0, bytes = 0;
  mutable std::mutex mutex;
  std::string problem, format;

  static GstFlowReturn take(GstAppSink* sink, gpointer data) {
    auto* one = static_cast<One*>(data);
    GstSample* sample = gst_app_sink_pull_sample(sink);
    if (!sample) return GST_FLOW_OK;
    CameraFrame frame{.camera = one->index, .sample = sample, .came = one->cameras->now()};
    GstCaps* reference = gst_caps_from_string(kCaptureTime);
    const auto* meta = gst_buffer_get_reference_timestamp_meta(gst_sample_get_buffer(sample), reference);
    gst_caps_unref(reference);
    frame.taken = meta ? seconds(meta->timestamp) : frame.came;
    one->frames++;
    if (one->cameras->on_frame_) one->cameras->on_frame_(frame);
    gst_sample_unref(sample);
    return GST_FLOW_OK;
  }

  // Counts what a source gives, and remembers what it is.
  void watch(GstPad* pad) {
    constexpr auto kData = GstPadProbeType(GST_PAD_PROBE_TYPE_BUFFER | GST_PAD_PROBE_TYPE_BUFFER_LIST);
    gst_pad_add_probe(
        pad, kData,
        [](GstPad* pad, GstPadProbeInfo* info, gpointer data) {
          auto* one = static_cast<One*>(data);
          if (info->type & GST_PAD_PROBE_TYPE_BUFFER)
            one->bytes += gst_buffer_get_size(GST_PAD_PROBE_INFO_BUFFER(info));
          else
            one->bytes += gst_buffer_list_calculate_size(GST_PAD_PROBE_INFO_BUFFER_LIST(info));
          const std::lock_guard lock(one->mutex);
          if (one->format.empty()) one->format = format_of(pad);
          return GST_PAD_PROBE_OK;
        },
        this, nullptr);
  }
};

RigCameras::RigCameras(std::shared_ptr<const Rig> rig, const std::string& path, Options options, OnFrame on_frame)
    : rig_(std::move(rig)), options_(std::move(options)), on_frame_(std::move(on_frame)) {
  if (options_.cameras.empty())
    for (CameraIndex i = 0; i < rig_->cameras.size(); i++) options_.cameras.push_back(i);
  all_.resize(rig_->cameras.size());
  pipeline_ = GST_ELEMENT(gst_object_ref_sink(gst_pipeline_new("cameras")));
  try {
    for (const CameraIndex index : options_.cameras) {
      auto& one = all_[index] = std::make_unique<One>();
      one->cameras = this;
      one->index = index;
      one->source = make("lfcamsrc");
      gst_bin_add(GST_BIN(pipeline_), one->source);
      g_signal_connect(one->source, "deep-element-added", G_CALLBACK(on_child), one.get());
      g_object_set(one->source, "rig", path.c_str(), "camera", rig_->cameras[index].id, "is-live", TRUE, "loop", TRUE,
                   "retry", TRUE, "decode", options_.decode, "trusted", options_.trusted, nullptr);
      if (options_.fps > 0) g_object_set(one->source, "framerate", options_.fps, 1, nullptr);
      GstElement* sink = make("appsink");
      gst_bin_add(GST_BIN(pipeline_), sink);
      g_object_set(sink, "sync", FALSE, "async", FALSE, "enable-last-sample", FALSE, "qos", FALSE, nullptr);
      GstAppSinkCallbacks callbacks = {};
      callbacks.new_sample = One::take;
      gst_app_sink_set_callbacks(GST_APP_SINK(sink), &callbacks, one.get(), nullptr);
      gst_element_link(one->source, sink);
    }
  } catch (...) {
    gst_object_unref(pipeline_);
    throw;
  }
  clock_ = gst_system_clock_obtain();
  gst_pipeline_use_clock(GST_PIPELINE(pipeline_), clock_);
}

RigCameras::~RigCameras() {
  stop();
  gst_object_unref(pipeline_);
  gst_object_unref(clock_);
}

void RigCameras::start() { gst_element_set_state(pipeline_, GST_STATE_PLAYING); }

void RigCameras::stop() {
  read_messages(0);
  gst_element_set_state(pipeline_, GST_STATE_NULL);
}

double RigCameras::now() const { return seconds(gst_clock_get_time(clock_)); }

void RigCameras::wait(double duration, const std::function<bool()>& done) {
  read_messages(0);
  for (const double end = now() + duration; now() < end && !(done && done());) read_messages(kStep);
}

// What is lost and found, of each camera; the pipeline itself has no errors but those of cameras.
void RigCameras::read_messages(GstClockTime timeout) {
  GstBus* bus = gst_element_get_bus(pipeline_);
  constexpr auto kOfUse = GstMessageType(GST_MESSAGE_ELEMENT | GST_MESSAGE_ERROR);
  while (GstMessage* message = gst_bus_timed_pop_filtered(bus, timeout, kOfUse)) {
    for (const auto& one : all_) {
      if (!one || GST_MESSAGE_SRC(message) != GST_OBJECT(one->source)) continue;
      const std::lock_guard lock(one->mutex);
      if (GST_MESSAGE_TYPE(message) == GST_MESSAGE_ERROR) {
        g_autoptr(GError) error = nullptr;
        gst_message_parse_error(message, &error, nullptr);
        one->problem = error->message;
      } else if (gst_message_has_name(message, "lightfield-camera-lost")) {
        one->problem = gst_structure_get_string(gst_message_get_structure(message), "reason");
      }
    }
    gst_message_unref(message);
    timeout = 0;
  }
  gst_object_unref(bus);
}

// Of rtspsrc its own pads count, and not the sockets inside; of all others what has no sink pads.
void RigCameras::on_child(GstBin*, GstBin* parent, GstElement* child, gpointer data) {
  const auto is_rtsp = [](gpointer element) {
    GstElementFactory* factory = gst_element_get_factory(GST_ELEMENT(element));
    return factory && g_str_equal(GST_OBJECT_NAME(factory), "rtspsrc");
  };
  for (GstObject* above = GST_OBJECT(parent); above; above = GST_OBJECT_PARENT(above))
    if (is_rtsp(above)) return;
  if (is_rtsp(child)) {
    g_signal_connect(child, "pad-added",
                     G_CALLBACK(+[](GstElement*, GstPad* pad, gpointer one) { static_cast<One*>(one)->watch(pad); }),
                     data);
    return;
  }
  if (GST_IS_BIN(child) || child->sinkpads) return;
  for (GList* pad = child->srcpads; pad; pad = pad->next) static_cast<One*>(data)->watch(GST_PAD(pad->data));
}

uint64_t RigCameras::frames(CameraIndex camera) const { return all_[camera]->frames; }
uint64_t RigCameras::source_bytes(CameraIndex camera) const { return all_[camera]->bytes; }

std::string RigCameras::problem(CameraIndex camera) const {
  const std::lock_guard lock(all_[camera]->mutex);
  return all_[camera]->problem;
}

std::string RigCameras::format(CameraIndex camera) const {
  const std::lock_guard lock(all_[camera]->mutex);
  return all_[camera]->format;
}

GstStructure* RigCameras::stats(CameraIndex camera) const {
  GstStructure* stats = nullptr;
  g_object_get(all_[camera]->source, "stats", &stats, nullptr);
  return stats;
}

std::string name_of(const Camera& camera) {
  return std::to_string(camera.id) + (camera.name.empty() ? "" : " (" + camera.name + ")");
}

}  // namespace lf::cameras
