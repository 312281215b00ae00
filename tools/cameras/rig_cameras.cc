// SPDX-License-Identifier: LGPL-2.1-or-later
#include "cameras/rig_cameras.h"

#include <algorithm>
#include <cstdint>
#include <cstring>
#include <filesystem>
#include <memory>
#include <set>
#include <span>
#include <utility>
#include <vector>

#include <gst/app/gstappsink.h>
#include <gst/gst.h>
#include <gst/video/video.h>
#include <unistd.h>
#include <nlohmann/json.hpp>

#include "base/text.h"
#include "jpeg/jpeg_frame.h"
#include "rig/rig_json.h"
#include "rig/source_security.h"

namespace lf::cameras {
namespace {

Image rgb_of_jpeg(GstBuffer* buffer) {
  auto bytes = std::make_shared<std::vector<uint8_t>>(gst_buffer_get_size(buffer));
  gst_buffer_extract(buffer, 0, bytes->data(), bytes->size());
  std::string reason;
  const std::shared_ptr<JpegFrame> frame = JpegFrame::open(bytes, std::span<const uint8_t>(*bytes), &reason);
  if (!frame || !frame->ensure({0, 0, frame->width(), frame->height()}, &reason)) throw Error(reason);
  const ImageView view = frame->view();
  Image image(PixelFamily::kI420, view.width, view.height);
  for (int plane = 0; plane < 3; plane++) {
    const int width = plane ? chroma_size(view.width) : view.width,
              height = plane ? chroma_size(view.height) : view.height;
    for (int y = 0; y < height; y++)
      std::memcpy(image.plane(plane) + static_cast<ptrdiff_t>(y) * width, view.plane[plane] + y * view.stride[plane],
                  static_cast<size_t>(width));
  }
  return to_rgb(image);
}

constexpr char kCaptureTime[] = "timestamp/x-lightfield-capture";
constexpr GstClockTime kStep = GST_SECOND / 20;

GstElement* make(const char* factory) {
  GstElement* element = gst_element_factory_make(factory, nullptr);
  if (!element) throw Error(std::string("element ") + factory + " is not installed");
  return element;
}

double seconds(GstClockTime time) { return static_cast<double>(time) / GST_SECOND; }

std::string format_of(GstPad* pad) {
  g_autoptr(GstCaps) caps = gst_pad_get_current_caps(pad);
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
  return format;
}

}  // namespace

Image rgb_of(GstBuffer* buffer, GstCaps* caps) {
  if (!caps || !buffer) throw Error("a frame has no caps");
  if (gst_structure_has_name(gst_caps_get_structure(caps, 0), "image/jpeg")) return rgb_of_jpeg(buffer);
  GstVideoInfo from, to;
  GstVideoFrame in, out;
  if (!gst_video_info_from_caps(&from, caps) || !gst_video_frame_map(&in, &from, buffer, GST_MAP_READ))
    throw Error("a frame cannot be read");
  gst_video_info_set_format(&to, GST_VIDEO_FORMAT_RGB, static_cast<guint>(from.width), static_cast<guint>(from.height));
  // GstVideoConverter cannot change frame rate and interlacing, so both stay as in the input.
  to.fps_n = from.fps_n;
  to.fps_d = from.fps_d;
  to.interlace_mode = from.interlace_mode;
  g_autoptr(GstBuffer) converted = gst_buffer_new_allocate(nullptr, GST_VIDEO_INFO_SIZE(&to), nullptr);
  gst_video_frame_map(&out, &to, converted, GST_MAP_WRITE);
  GstVideoConverter* converter = gst_video_converter_new(&from, &to, nullptr);
  Image image(PixelFamily::kRgb, from.width, from.height);
  if (converter) {
    gst_video_converter_frame(converter, &in, &out);
    for (int y = 0; y < from.height; y++)
      std::memcpy(image.pixel(0, y),
                  static_cast<const uint8_t*>(GST_VIDEO_FRAME_PLANE_DATA(&out, 0)) +
                      static_cast<ptrdiff_t>(y) * GST_VIDEO_FRAME_PLANE_STRIDE(&out, 0),
                  3 * static_cast<size_t>(from.width));
    gst_video_converter_free(converter);
  }
  gst_video_frame_unmap(&out);
  gst_video_frame_unmap(&in);
  if (!converter) throw Error("a frame has a format that cannot be converted to RGB");
  return image;
}

GreyImage small_grey_of(GstSample* sample, int smaller) {
  GstVideoInfo info;
  GstVideoFrame frame;
  GstCaps* caps = gst_sample_get_caps(sample);
  if (!caps || !gst_video_info_from_caps(&info, caps) ||
      !gst_video_frame_map(&frame, &info, gst_sample_get_buffer(sample), GST_MAP_READ))
    throw Error("a frame cannot be read");
  GreyImage picture{info.width / smaller, info.height / smaller, {}};
  picture.samples.reserve(static_cast<size_t>(picture.width) * static_cast<size_t>(picture.height));
  // Grey is the average of red, green and blue, because lights may be coloured.
  const int components = GST_VIDEO_INFO_IS_RGB(&info) ? 3 : 1;
  const int count = smaller * smaller * components;
  for (int y = 0; y < picture.height; y++)
    for (int x = 0; x < picture.width; x++) {
      int sum = 0;
      for (int c = 0; c < components; c++) {
        const int step = GST_VIDEO_FRAME_COMP_PSTRIDE(&frame, c);
        const auto* row = static_cast<const uint8_t*>(GST_VIDEO_FRAME_COMP_DATA(&frame, c)) +
                          static_cast<ptrdiff_t>(y) * smaller * GST_VIDEO_FRAME_COMP_STRIDE(&frame, c) +
                          static_cast<ptrdiff_t>(x) * smaller * step;
        for (int v = 0; v < smaller; v++, row += GST_VIDEO_FRAME_COMP_STRIDE(&frame, c))
          for (int u = 0; u < smaller; u++) sum += row[u * step];
      }
      picture.samples.push_back(static_cast<uint8_t>(sum / count));
    }
  gst_video_frame_unmap(&frame);
  return picture;
}

bool is_jpeg(GstSample* sample) {
  GstCaps* caps = gst_sample_get_caps(sample);
  return caps && gst_structure_has_name(gst_caps_get_structure(caps, 0), "image/jpeg");
}

std::vector<uint8_t> bytes_of(GstSample* sample) {
  GstBuffer* buffer = gst_sample_get_buffer(sample);
  std::vector<uint8_t> bytes(gst_buffer_get_size(buffer));
  gst_buffer_extract(buffer, 0, bytes.data(), bytes.size());
  return bytes;
}

double brightness_of(const Image& rgb) {
  uint64_t sum = 0;
  for (size_t i = 0; i + 2 < rgb.data().size(); i += 3)
    sum += 299u * rgb.data()[i] + 587u * rgb.data()[i + 1] + 114u * rgb.data()[i + 2];
  const double pixels = static_cast<double>(rgb.data().size()) / 3;
  return pixels > 0 ? static_cast<double>(sum) / 1000 / pixels : 0;
}

struct RigCameras::CameraState {
  RigCameras* cameras = nullptr;
  CameraIndex index = 0;
  GstElement* source = nullptr;  // lfcamsrc; owned by the pipeline
  std::atomic<uint64_t> frames = 0, bytes = 0;
  mutable std::mutex mutex;
  std::string problem, format;

  static GstFlowReturn take(GstAppSink* sink, gpointer data) {
    auto* one = static_cast<CameraState*>(data);
    g_autoptr(GstSample) sample = gst_app_sink_pull_sample(sink);
    if (!sample) return GST_FLOW_OK;
    CameraFrame frame{.camera = one->index, .sample = sample, .arrival_time = one->cameras->now()};
    g_autoptr(GstCaps) reference = gst_caps_from_string(kCaptureTime);
    const auto* meta = gst_buffer_get_reference_timestamp_meta(gst_sample_get_buffer(sample), reference);
    frame.taken = meta ? seconds(meta->timestamp) : frame.arrival_time;
    one->frames++;
    if (one->cameras->on_frame_) one->cameras->on_frame_(frame);
    return GST_FLOW_OK;
  }

  void watch(GstPad* pad) {
    constexpr auto kData = GstPadProbeType(GST_PAD_PROBE_TYPE_BUFFER | GST_PAD_PROBE_TYPE_BUFFER_LIST);
    gst_pad_add_probe(
        pad, kData,
        [](GstPad* pad, GstPadProbeInfo* info, gpointer data) {
          auto* one = static_cast<CameraState*>(data);
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
      auto& one = all_[index] = std::make_unique<CameraState>();
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
      callbacks.new_sample = CameraState::take;
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

void RigCameras::wait_for_frames(double duration) {
  wait(duration, [this] { return std::ranges::all_of(cameras(), [this](CameraIndex i) { return is_settled(i); }); });
}

// Reads the errors of the cameras from the bus. The pipeline itself posts no other errors.
void RigCameras::read_messages(GstClockTime timeout) {
  g_autoptr(GstBus) bus = gst_element_get_bus(pipeline_);
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
}

// Watches the output of the elements that receive the camera's bytes: rtspsrc, not its inner sockets, or otherwise
// elements without sink pads.
void RigCameras::on_child(GstBin*, GstBin* parent, GstElement* child, gpointer data) {
  const auto is_rtsp = [](gpointer element) {
    GstElementFactory* factory = gst_element_get_factory(GST_ELEMENT(element));
    return factory && g_str_equal(GST_OBJECT_NAME(factory), "rtspsrc");
  };
  for (GstObject* above = GST_OBJECT(parent); above; above = GST_OBJECT_PARENT(above))
    if (is_rtsp(above)) return;
  if (is_rtsp(child)) {
    g_signal_connect(
        child, "pad-added",
        G_CALLBACK(+[](GstElement*, GstPad* pad, gpointer one) { static_cast<CameraState*>(one)->watch(pad); }), data);
    return;
  }
  if (GST_IS_BIN(child) || child->sinkpads) return;
  for (GList* pad = child->srcpads; pad; pad = pad->next) static_cast<CameraState*>(data)->watch(GST_PAD(pad->data));
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

TemporaryRig::TemporaryRig(Rig rig, const nlohmann::json& original, const std::string& path, bool trusted) {
  require_trust(rig, path, trusted);
  std::string pattern = (std::filesystem::temp_directory_path() / "lf-rig-XXXXXX").string();
  if (!mkdtemp(pattern.data())) throw Error(pattern + ": the temporary folder cannot be created");
  directory_ = pattern;
  rebase_paths(rig, directory_);
  save_rig(rig, this->path(), &original);
  rig_ = std::make_shared<const Rig>(load_rig(this->path()));
}

TemporaryRig::~TemporaryRig() {
  std::error_code ignored;
  std::filesystem::remove_all(directory_, ignored);
}

}  // namespace lf::cameras

namespace {

namespace fs = std::filesystem;

std::string text_in(GstDevice* device, std::initializer_list<const char*> fields) {
  std::string text;
  if (GstStructure* properties = gst_device_get_properties(device)) {
    for (const char* field : fields)
      if (const char* value = gst_structure_get_string(properties, field); value && text.empty()) text = value;
    gst_structure_free(properties);
  }
  return text;
}

std::string port_of(const std::string& device, const std::string& by_path) {
  std::error_code error;
  const fs::path real = fs::canonical(device, error);
  if (error) return "";
  std::set<std::string> links;
  for (const fs::directory_entry& entry : fs::directory_iterator(by_path, error))
    if (fs::canonical(entry.path(), error) == real && !error) links.insert(entry.path().string());
  return links.empty() ? "" : *links.begin();  // USB 2 and USB 3 may each have a link to one device
}

std::string value_text(const GValue* value) {
  if (G_VALUE_HOLDS_STRING(value)) {
    g_autofree gchar* escaped = g_strescape(g_value_get_string(value), nullptr);
    return "\"" + std::string(escaped) + "\"";
  }
  g_autofree gchar* text = gst_value_serialize(value);
  return text ? text : "";
}

// Returns a launch description of the device, as gst-device-monitor-1.0 prints: its element with all properties that
// differ from the defaults. Returns an empty text if there is none.
std::string element_of(GstDevice* device) {
  g_autoptr(GstElement) element = gst_device_create_element(device, nullptr);
  if (!element) return "";
  gst_object_ref_sink(element);
  std::string line;
  GstElementFactory* factory = gst_element_get_factory(element);
  GstElement* plain = factory ? gst_element_factory_create(factory, nullptr) : nullptr;
  if (plain) {
    gst_object_ref_sink(plain);
    line = GST_OBJECT_NAME(factory);
    guint count = 0;
    g_autofree GParamSpec** specs = g_object_class_list_properties(G_OBJECT_GET_CLASS(element), &count);
    for (guint i = 0; i < count; i++) {
      constexpr auto kBoth = G_PARAM_READWRITE;
      if ((specs[i]->flags & kBoth) != kBoth || g_str_equal(specs[i]->name, "name") ||
          g_str_equal(specs[i]->name, "parent"))
        continue;
      GValue set = G_VALUE_INIT, usual = G_VALUE_INIT;
      g_object_get_property(G_OBJECT(element), specs[i]->name, &set);
      g_object_get_property(G_OBJECT(plain), specs[i]->name, &usual);
      if (gst_value_compare(&set, &usual) != GST_VALUE_EQUAL &&
          !(G_VALUE_HOLDS_STRING(&set) && !g_value_get_string(&set)))
        if (const std::string text = value_text(&set); !text.empty())
          line += std::string(" ") + specs[i]->name + "=" + text;
      g_value_unset(&set);
      g_value_unset(&usual);
    }
    gst_object_unref(plain);
  }
  // A launch description of a single word would be read as a file name.
  return line.empty() || line.find('=') != std::string::npos ? line : line + " ! identity";
}

bool is_screen(GstDevice* device) {
  g_autofree gchar* kind = gst_device_get_device_class(device);
  return std::strstr(kind, "Screen") || std::strstr(kind, "Monitor");
}

}  // namespace

std::vector<VideoDevice> find_video_devices(const std::string& by_path) {
  std::vector<VideoDevice> devices;
  std::set<std::string> paths;
  g_autoptr(GstDeviceMonitor) monitor = gst_device_monitor_new();
  gst_device_monitor_add_filter(monitor, "Video/Source", nullptr);
  if (gst_device_monitor_start(monitor)) {
    GList* list = gst_device_monitor_get_devices(monitor);
    for (GList* item = list; item; item = item->next) {
      GstDevice* device = GST_DEVICE(item->data);
      if (is_screen(device)) continue;
      VideoDevice found;
      if (const std::string path = text_in(device, {"device.path", "api.v4l2.path"}); !path.empty()) {
        if (!paths.insert(path).second) continue;
        const std::string port = port_of(path, by_path);
        found.source = "v4l2://" + (port.empty() ? path : port);
        found.stable = !port.empty();
      } else {
        found.source = element_of(device);
        found.stable = found.source.find('=') != std::string::npos;
      }
      if (found.source.empty()) continue;
      g_autofree gchar* name = gst_device_get_display_name(device);
      found.name = name ? name : "";
      if (const std::string serial = text_in(device, {"device.serial", "serial", "device.serial-number"});
          !serial.empty())
        found.name += ", serial " + serial;
      devices.push_back(found);
    }
    g_list_free_full(list, gst_object_unref);
    gst_device_monitor_stop(monitor);
  }
  std::ranges::stable_sort(devices, lf::natural_less, &VideoDevice::source);
  devices.erase(
      std::unique(devices.begin(), devices.end(), [](const auto& a, const auto& b) { return a.source == b.source; }),
      devices.end());
  return devices;
}
