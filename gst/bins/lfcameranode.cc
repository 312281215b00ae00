// SPDX-License-Identifier: LGPL-2.1-or-later

/**
 * SECTION:element-lfcameranode
 * @title: lfcameranode
 * @short_description: cameras of a rig as one node that answers view requests
 *
 * lfcameranode opens some or all cameras of a rig and answers view requests. An answer contains the sum of the cameras:
 * for each pixel of the view, the weighted sum of the images of this node's cameras. Use the element on a host with
 * cameras, or with lfviewrequest and lfcompositor in one pipeline.
 *
 * The bin contains one #element-lfcamsrc per camera and one #element-lffragment. View requests arrive at the pad
 * `request`, and the pad `src` delivers one answer per request. Each further client, such as a compositor on another
 * host, requests another pad `request_%u`. The answers to its requests leave by the pad with the same number, for
 * example `src_0` for `request_0`.
 *
 * If a camera fails, the node continues without it, and the neighbouring cameras contribute instead. The node opens a
 * live camera again and again until it works, unless `retry` is false. Cameras that are not live stay lost.
 * #element-lfcamsrc posts messages about each loss, and `stats` lists the state of each camera, the reason of its loss
 * and the number of retries. The node posts an error only if no camera has ever worked, or if all cameras are lost for
 * good.
 *
 * If `record` is set, the node records all cameras, so that other views can be rendered later. The recording is a
 * folder with one Matroska file per camera and a rig.json. This rig.json plays in lfcameranode with the same capture
 * times. JPEG, H.264, H.265, VP8, VP9 and AV1 are stored unchanged; raw video is encoded as JPEG of quality 95. If the
 * disk is slow or full, frames are missing in the recording and counted in `stats`, but cameras and viewers continue.
 * After a crash, the files can be played up to the crash.
 *
 * ## Example launch lines
 * |[
 * gst-launch-1.0 lfviewrequest location=views.json ! tee name=r  r. ! queue ! n.request \
 *   lfcameranode name=n rig=rig.json ! c.sink_0  r. ! queue ! c.request \
 *   lfcompositor name=c rig=rig.json ! videoconvert ! pngenc ! multifilesink location=out_%02d.png
 * ]| Renders a PNG file for each view in views.json.
 * |[
 * gst-launch-1.0 lfcameranode rig=rig.json is-live=true loop=true record=recording
 * ]| Records all cameras until Ctrl-C.
 *
 * ## Element messages
 * The bin forwards the messages of its cameras and adds:
 *
 * - "lightfield-all-cameras-lost": all cameras are lost, but some will be reopened. Fields: cameras (uint: number of
 *   cameras), reason (string: reasons of all cameras). The node also posts one warning. The next
 *   "lightfield-camera-found" ends this state.
 * - "lightfield-recording-stopped": the recording has ended, for example because the disk is full. Fields: folder,
 *   reason (strings). The node also posts one warning.
 */

#include "bins/lfcameranode.h"

#include <algorithm>
#include <atomic>
#include <filesystem>
#include <map>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include <gst/gst.h>

#include "base/schedule.h"
#include "base/text.h"
#include "bins/property_proxy.h"
#include "camsrc/lfcamsrc.h"
#include "common/common.h"
#include "common/gst_pointers.h"
#include "common/guard.h"
#include "common/properties.h"
#include "fragment/lffragment.h"
#include "recording/recording.h"
#include "rig/camera_source.h"
#include "rig/rig.h"

GST_DEBUG_CATEGORY_STATIC(lf_camera_node_debug);
#define GST_CAT_DEFAULT lf_camera_node_debug

namespace lf {
namespace {

struct CameraNodeSettings {
  std::string rig;
  std::string cameras;
  int fps_n = 0, fps_d = 1;
  bool is_live = false;
  bool loop = false;
  bool decode = false;
  guint64 latency = 200 * GST_MSECOND;
  guint node = 0;
  bool retry = true;
  bool trusted = false;
  std::string record;
  bool operator==(const CameraNodeSettings&) const = default;

  static PropertyTable<CameraNodeSettings>& properties();
};

PropertyTable<CameraNodeSettings>& CameraNodeSettings::properties() {
  using S = CameraNodeSettings;
  static PropertyTable<S> table = {
      property<&S::rig>(
          kWhilePlaying, "rig", "Rig",
          "Path of the rig file (rig.json), which describes all cameras of the array. If the property is set while the "
          "element runs, the element loads the file again and uses it from the next request on. The new file must have "
          "the same cameras and sources. New time offsets take effect at the next start"),
      property<&S::cameras>(kWhileReady, "cameras", "Cameras",
                            "Ids of the cameras that this node opens, as a list of numbers and ranges. For example, "
                            "\"0-15,20\" selects 17 cameras (empty: all cameras of the rig)",
                            ""),
      fraction_property<&S::fps_n, &S::fps_d>(
          kWhileReady, "framerate", "Frame rate",
          "Frame rate of each camera, in frames per second. The element drops or repeats frames of videos to get "
          "this rate (0/1: rate of the source, or 15/1 if the source has none)",
          0, 1),
      property<&S::is_live>(
          kWhileReady, "is-live", "Is live",
          "If true, the node plays files and stills in real time, as if they were live cameras. The pipeline clock "
          "then determines the current frame. If false, the node reads each frame when a request needs it, so the "
          "output is the same on every machine. Devices and network cameras are always live"),
      property<&S::loop>(
          kWhileReady, "loop", "Loop",
          "If true, videos and image sequences repeat endlessly. If false, each camera ends with its file"),
      property<&S::node>(kWhileReady, "node", "Node",
                         "Number that identifies this node in its answers. It must be unique in the array, because "
                         "compositors use it to distinguish the nodes",
                         0u, G_MAXUINT),
      property<&S::decode>(
          kWhileReady, "decode", "Decode",
          "If true, the node decodes complete JPEG frames and downloads GPU frames to system memory as soon as they "
          "arrive. If false, it decodes only the regions that a request needs, which usually takes less time"),
      property<&S::latency>(
          kWhileReady, "latency", "Latency",
          "Size of the jitter buffer for network cameras (RTSP), in nanoseconds. Packets that arrive later than this "
          "are lost, so increase it if pictures of a camera are damaged. A larger buffer delays every frame",
          guint64{0}, guint64{60 * GST_SECOND}),
      property<&S::retry>(kWhileReady, "retry", "Retry",
                          "If true, the node reopens live cameras after a failure. The first attempt follows after "
                          "half a second, and the time between later attempts grows to ten seconds. If false, a failed "
                          "live camera stays lost. Cameras that are not live, such as files, always stay lost"),
      property<&S::record>(
          kWhileReady, "record", "Record",
          "Folder that receives a recording of all cameras. The recording consists of one file per camera and a "
          "rig.json, which plays in this element. The folder must not contain a rig.json yet (empty: no recording)"),
      property<&S::trusted>(
          kWhileReady, "trusted", "Trusted",
          "If true, the rig file may run any GStreamer element. Set this only for rig files from people you trust. If "
          "false, launch descriptions in the rig may contain only sources, converters and decoders from a fixed list"),
  };
  return table;
}

constexpr std::string_view kColon = ": ";
constexpr size_t kAlone = 3;

struct Reason {
  std::string_view place, why;
};

Reason parse(std::string_view text) {
  const size_t colon = text.rfind(kColon);
  if (colon == text.npos) return {"", text};
  return {text.substr(0, colon), text.substr(colon + kColon.size())};
}

}  // namespace

std::string grouped_reasons(std::span<const std::string> reasons, const std::string& separator) {
  std::map<std::string_view, size_t> cameras;
  for (const std::string& reason : reasons) cameras[parse(reason).why]++;
  std::string text;
  for (const std::string& reason : reasons) {
    const auto [place, why] = parse(reason);
    const size_t count = cameras[why];
    if (count == 0) continue;
    if (!text.empty()) text += separator;
    if (count <= kAlone) {
      text += reason;
      continue;
    }
    text += std::to_string(count) + " cameras: " + std::string(why);
    if (!place.empty()) text += " (" + std::string(place) + " and others)";
    cameras[why] = 0;
  }
  return text;
}

}  // namespace lf

using Settings = lf::CameraNodeSettings;

struct _LfCameraNode {
  GstBin parent;
  GstElement* fragment;  // borrowed; null if lffragment is not installed
  Settings* settings;    // guarded by the object lock
  Settings* opened;
  std::shared_ptr<const lf::Rig>* rig;
  std::vector<GstElement*>* cameras;          // borrowed; guarded by the object lock
  std::shared_ptr<lf::Recording>* recording;  // null if not recording; guarded by the object lock
  std::atomic<bool> failed;                   // the error "No camera works" has been posted since the last start
  std::atomic<bool> no_camera;                // the loss of all cameras has been reported
};

G_DEFINE_TYPE_WITH_CODE(LfCameraNode, lf_camera_node, GST_TYPE_BIN,
                        GST_DEBUG_CATEGORY_INIT(lf_camera_node_debug, "lfcameranode", 0, "cameras of a rig as a node"))
GST_ELEMENT_REGISTER_DEFINE(lfcameranode, "lfcameranode", GST_RANK_NONE, LF_TYPE_CAMERA_NODE)

static GstStaticPadTemplate request_template =
    GST_STATIC_PAD_TEMPLATE("request", GST_PAD_SINK, GST_PAD_ALWAYS, GST_STATIC_CAPS(LF_REQUEST_CAPS));
static GstStaticPadTemplate src_template =
    GST_STATIC_PAD_TEMPLATE("src", GST_PAD_SRC, GST_PAD_ALWAYS, GST_STATIC_CAPS(LF_ANSWER_CAPS));

static GstStaticPadTemplate more_request_template =
    GST_STATIC_PAD_TEMPLATE("request_%u", GST_PAD_SINK, GST_PAD_REQUEST, GST_STATIC_CAPS(LF_REQUEST_CAPS));
static GstStaticPadTemplate more_src_template =
    GST_STATIC_PAD_TEMPLATE("src_%u", GST_PAD_SRC, GST_PAD_SOMETIMES, GST_STATIC_CAPS(LF_ANSWER_CAPS));

static std::shared_ptr<lf::Recording> find_recording(LfCameraNode* self) {
  const lf::ObjectLock lock(self);
  return *self->recording;
}

// Connects one camera with the recording. Streaming threads call this function with raw pointers, which is safe because
// node and camera outlive the streams.
static void tap_camera(LfCameraNode* self, GstElement* element, guint id) {
  LfCamSrc* camera = LF_CAM_SRC(element);
  lf_cam_src_set_tap(camera, [=](GstBuffer* buffer, GstCaps* caps, GstClockTime captured) {
    const std::shared_ptr<lf::Recording> recording = find_recording(self);
    if (recording) recording->add(id, buffer, caps, captured, lf_cam_src_is_live(camera));
  });
}

// Starts the recording if the property `record` is set. Call while stopped. Returns false after posting an error.
static bool start_recording(LfCameraNode* self) {
  const std::string& folder = self->opened->record;
  if (folder.empty()) return true;
  try {
    const lf::Rig& rig = **self->rig;
    auto recording = std::make_shared<lf::Recording>(GST_ELEMENT(self), folder, rig, self->opened->rig,
                                                     lf::parse_camera_list(rig, self->opened->cameras));
    const lf::ObjectLock lock(self);
    *self->recording = std::move(recording);
    return true;
  } catch (const std::exception& error) {
    GST_ELEMENT_ERROR(self, RESOURCE, OPEN_WRITE, ("record: %s", error.what()), (nullptr));
    return false;
  }
}

// Ends the recording. Call when the cameras have stopped.
static void finish_recording(LfCameraNode* self) {
  const std::shared_ptr<lf::Recording> recording = find_recording(self);
  if (!recording) return;
  recording->finish();
  const lf::ObjectLock lock(self);
  self->recording->reset();
}

static std::vector<lf::ElementPtr> hold_cameras(LfCameraNode* self) {
  std::vector<lf::ElementPtr> cameras;
  const lf::ObjectLock lock(self);
  for (GstElement* camera : *self->cameras) cameras.emplace_back(GST_ELEMENT(gst_object_ref(camera)));
  return cameras;
}

namespace {

struct LostCameras {
  bool has_worked = false, for_good = true;
  std::vector<std::string> reasons;
};

}  // namespace

// Returns the lost cameras and their reasons if no camera works. Returns nothing while at least one camera works or is
// opened for the first time.
static std::optional<LostCameras> lost_cameras(LfCameraNode* self) {
  LostCameras losses;
  for (const lf::ElementPtr& camera : hold_cameras(self)) {
    const lf::CameraLifecycle::Report report = lf_cam_src_lifecycle(LF_CAM_SRC(camera.get())).report();
    if (report.state != lf::CameraLifecycle::State::kLost) return std::nullopt;
    losses.has_worked = losses.has_worked || report.worked;
    losses.for_good = losses.for_good && lf_cam_src_is_lost_for_good(LF_CAM_SRC(camera.get()));
    losses.reasons.push_back(report.reason);
  }
  return losses;
}

static void post_no_camera(LfCameraNode* self, const LostCameras& losses) {
  if (self->no_camera.exchange(true)) return;
  if (!lost_cameras(self)) {  // a camera may have returned just before the flag was set
    self->no_camera = false;
    return;
  }
  const std::string reasons = lf::grouped_reasons(losses.reasons, "; ");
  GstStructure* structure =
      gst_structure_new(LF_NO_CAMERA, "cameras", G_TYPE_UINT, static_cast<guint>(losses.reasons.size()), "reason",
                        G_TYPE_STRING, reasons.c_str(), nullptr);
  gst_element_post_message(GST_ELEMENT(self), gst_message_new_element(GST_OBJECT(self), structure));
  GST_ELEMENT_WARNING(self, RESOURCE, NOT_FOUND, ("No camera works any more: %s", reasons.c_str()), (nullptr));
}

// Call from any thread when a camera is lost. Posts an error if no camera works and none will be reopened. If cameras
// may be reopened, posts one warning and one element message per outage instead.
static void check_cameras(LfCameraNode* self) {
  const std::optional<LostCameras> losses = lost_cameras(self);
  if (!losses) return;
  if (losses->has_worked && !losses->for_good) return post_no_camera(self, *losses);
  if (self->failed.exchange(true)) return;
  GST_ELEMENT_ERROR(self, RESOURCE, NOT_FOUND,
                    ("No camera works:\n%s", lf::grouped_reasons(losses->reasons, "\n").c_str()), (nullptr));
}

// Waits until each camera has delivered a frame or is lost, but at most for kStartTimeout. If no camera works, `failed`
// is then true, so the state change can fail with a clear error.
static void wait_for_cameras(LfCameraNode* self) {
  constexpr uint64_t kStartTimeout = 2'000'000'000;
  const auto is_opening = [](const lf::ElementPtr& camera) {
    return lf_cam_src_lifecycle(LF_CAM_SRC(camera.get())).state() == lf::CameraLifecycle::State::kOpening;
  };
  const std::vector<lf::ElementPtr> cameras = hold_cameras(self);
  for (const uint64_t end = lf::now_ns() + kStartTimeout;
       lf::now_ns() < end && std::ranges::any_of(cameras, is_opening);)
    g_usleep(1000);
  check_cameras(self);  // The camera updates its state before it posts its message.
}

// Returns the value of the property `stats`: the counters of lffragment and the structure `cameras` with one structure
// "camera-ID" per camera. The caller owns the result.
static GstStructure* stats_of(LfCameraNode* self) {
  GstStructure* stats = nullptr;
  if (self->fragment) g_object_get(self->fragment, "stats", &stats, nullptr);
  if (!stats) stats = gst_structure_new_empty("lightfield-fragment-stats");
  g_autoptr(GstStructure) cameras = gst_structure_new_empty("lightfield-cameras");
  const std::shared_ptr<lf::Recording> recording = find_recording(self);
  for (const lf::ElementPtr& camera : hold_cameras(self)) {
    guint id = 0;
    g_object_get(camera.get(), "camera", &id, nullptr);
    const std::string name = "camera-" + std::to_string(id);
    g_autoptr(GstStructure) one = lf_cam_src_stats(LF_CAM_SRC(camera.get()), name.c_str());
    if (recording) {
      const lf::CameraFile::Counts counts = recording->counts(id);
      gst_structure_set(one, "recorded", G_TYPE_UINT64, counts.frames, "unrecorded", G_TYPE_UINT64, counts.dropped,
                        nullptr);
    }
    gst_structure_set(cameras, name.c_str(), GST_TYPE_STRUCTURE, one, nullptr);
  }
  gst_structure_set(stats, "cameras", GST_TYPE_STRUCTURE, cameras, nullptr);
  if (recording) {
    g_autoptr(GstStructure) of_all = recording->stats();
    gst_structure_set(stats, "recording", GST_TYPE_STRUCTURE, of_all, nullptr);
  }
  return stats;
}

static Settings& settings_of(LfCameraNode* self) { return *self->settings; }
using Properties = lf::Properties<settings_of, stats_of>;
static Settings current_settings(LfCameraNode* self) { return Properties::now(self); }

static void remove_cameras(LfCameraNode* self) {
  lf::ObjectLock lock(self);
  const std::vector<GstElement*> cameras = std::exchange(*self->cameras, {});
  lock.unlock();
  for (GstElement* camera : cameras) {
    g_autoptr(GstPad) src = gst_element_get_static_pad(camera, "src");
    g_autoptr(GstPad) sink = gst_pad_get_peer(src);
    gst_element_set_state(camera, GST_STATE_NULL);
    gst_bin_remove(GST_BIN(self), camera);
    if (sink) gst_element_release_request_pad(self->fragment, sink);
  }
}

static void add_camera(LfCameraNode* self, const Settings& settings, const lf::Rig& rig, lf::CameraIndex index) {
  const std::string id = std::to_string(rig.cameras[index].id);
  GstElement* camera = gst_element_factory_make("lfcamsrc", ("camera" + id).c_str());
  if (!camera)
    throw lf::Error(
        "element lfcamsrc is not installed (set GST_PLUGIN_PATH to the folder of the "
        "gst-lightfield plugin)");
  g_object_set(camera, "rig", settings.rig.c_str(), "camera", rig.cameras[index].id, "is-live", settings.is_live,
               "loop", settings.loop, "decode", settings.decode, "latency", settings.latency, "retry", settings.retry,
               "trusted", settings.trusted, nullptr);
  lf_cam_src_set_optional(LF_CAM_SRC(camera));
  gst_util_set_object_arg(G_OBJECT(camera), "framerate",
                          (std::to_string(settings.fps_n) + "/" + std::to_string(settings.fps_d)).c_str());
  if (!settings.record.empty()) tap_camera(self, camera, rig.cameras[index].id);
  lf::ObjectLock lock(self);
  self->cameras->push_back(camera);  // first, because it may throw
  lock.unlock();
  gst_bin_add(GST_BIN(self), camera);
  if (!gst_element_link_pads(camera, "src", self->fragment, ("sink_" + std::to_string(index)).c_str()))
    throw lf::Error(settings.rig + ": camera " + id + ": can't be linked with lffragment");
  gst_child_proxy_set(GST_CHILD_PROXY(self->fragment), ("sink_" + std::to_string(index) + "::camera").c_str(),
                      static_cast<gint>(rig.cameras[index].id), nullptr);
}

// Warns that cameras without a source film the built-in scene. The cameras of an imported rig may be far from this
// scene, and all views are then black.
static void warn_of_scene(LfCameraNode* self, const std::string& rig) {
  GST_ELEMENT_WARNING(self, RESOURCE, NOT_FOUND,
                      ("%s: no camera names an image or a source, so all cameras show the built-in scene. Add a "
                       "\"source\" or an \"image\" to each camera in the rig file",
                       rig.c_str()),
                      (nullptr));
}

static bool open_cameras(LfCameraNode* self) {
  remove_cameras(self);
  const Settings settings = current_settings(self);
  try {
    if (!self->fragment)
      throw lf::Error(
          "element lffragment is not installed (set GST_PLUGIN_PATH to the folder of "
          "the gst-lightfield plugin)");
    if (settings.rig.empty()) throw lf::Error("rig: not set (rig=RIG.json names the array's rig file)");
    if (!g_file_test(settings.rig.c_str(), G_FILE_TEST_EXISTS)) throw lf::Error(settings.rig + ": no such file");
    const std::shared_ptr<const lf::Rig> rig = lf::shared_rig(settings.rig);
    std::vector<lf::CameraIndex> indices;
    try {
      indices = lf::parse_camera_list(*rig, settings.cameras);
    } catch (const lf::Error& error) {
      throw lf::Error(settings.rig + ": cameras \"" + settings.cameras + "\": " + error.what());
    }
    g_object_set(self->fragment, "rig", settings.rig.c_str(), "node", settings.node, nullptr);
    for (const lf::CameraIndex index : indices) add_camera(self, settings, *rig, index);
    *self->opened = settings;
    *self->rig = rig;
    if (lf::has_no_pictures(*rig)) warn_of_scene(self, settings.rig);
    return true;
  } catch (const std::exception& error) {
    GST_ELEMENT_ERROR(self, RESOURCE, SETTINGS, ("%s", error.what()), (nullptr));
  }
  remove_cameras(self);
  return false;
}

// Returns how the cameras and sources of the rig differ from those of the open rig, or "" if they are the same.
static std::string source_change(LfCameraNode* self, const lf::Rig& rig) {
  const lf::Rig& before = **self->rig;
  const auto place = [](const lf::Rig& of, const std::string& path) {
    return lf::is_uri(path) ? path : std::filesystem::path(of.resolve(path)).lexically_normal().string();
  };
  try {
    std::vector<lf::CameraIndex> own = lf::parse_camera_list(before, self->opened->cameras);
    if (lf::parse_camera_list(rig, self->opened->cameras).size() != own.size())
      throw lf::Error("the new rig has a different number of cameras");
    for (const lf::CameraIndex index : own) {
      const lf::Camera& was = before.cameras[index];
      const auto is = rig.index_of_id(was.id);
      if (!is) throw lf::Error("the new rig has no camera " + std::to_string(was.id));
      const lf::Camera& now = rig.cameras[*is];
      if (place(before, was.source) != place(rig, now.source) || place(before, was.image) != place(rig, now.image))
        throw lf::Error("camera " + std::to_string(was.id) + " has another source");
    }
    return "";
  } catch (const lf::Error& error) {
    return error.what();
  }
}

// Switches a running node to a new rig file. The new rig is used by lffragment only, and the cameras continue.
static void lf_camera_node_set_rig(LfCameraNode* self, const gchar* path) {
  if (lf::is_running(GST_ELEMENT(self))) {
    const std::shared_ptr<const lf::Rig> rig = lf::reload_rig(GST_ELEMENT(self), path);
    if (!rig) return;
    if (const std::string problem = source_change(self, *rig); !problem.empty()) {
      GST_ELEMENT_WARNING(
          self, RESOURCE, SETTINGS,
          ("%s: %s: restart this node to use this rig. The current rig stays in use.", path, problem.c_str()),
          (nullptr));
      return;
    }
    g_object_set(self->fragment, "rig", path, nullptr);
    if (const auto recording = find_recording(self)) recording->update_rig(*rig, path);
  }
  const lf::ObjectLock lock(self);
  self->settings->rig = path ? path : "";
}

static void lf_camera_node_handle_message(GstBin* bin, GstMessage* message) {
  const GstStructure* structure =
      GST_MESSAGE_TYPE(message) == GST_MESSAGE_ELEMENT ? gst_message_get_structure(message) : nullptr;
  const bool is_loss = structure && gst_structure_has_name(structure, LF_CAMERA_LOST);
  if (structure && gst_structure_has_name(structure, LF_CAMERA_FOUND)) LF_CAMERA_NODE(bin)->no_camera = false;
  GST_BIN_CLASS(lf_camera_node_parent_class)->handle_message(bin, message);
  if (is_loss) check_cameras(LF_CAMERA_NODE(bin));
}

static GstStateChangeReturn lf_camera_node_change_state(GstElement* element, GstStateChange transition) {
  LfCameraNode* self = LF_CAMERA_NODE(element);
  const bool stale = transition == GST_STATE_CHANGE_NULL_TO_READY ||
                     (transition == GST_STATE_CHANGE_READY_TO_PAUSED && *self->opened != current_settings(self));
  if (stale && !open_cameras(self)) return GST_STATE_CHANGE_FAILURE;
  const bool starts = transition == GST_STATE_CHANGE_NULL_TO_READY || transition == GST_STATE_CHANGE_READY_TO_PAUSED;
  if (starts) self->failed = self->no_camera = false;
  if (transition == GST_STATE_CHANGE_READY_TO_PAUSED && !start_recording(self)) return GST_STATE_CHANGE_FAILURE;
  GstStateChangeReturn result = GST_ELEMENT_CLASS(lf_camera_node_parent_class)->change_state(element, transition);
  if (transition == GST_STATE_CHANGE_READY_TO_PAUSED && !self->opened->is_live && result == GST_STATE_CHANGE_SUCCESS)
    wait_for_cameras(self);
  if (starts && self->failed) result = GST_STATE_CHANGE_FAILURE;
  if (transition == GST_STATE_CHANGE_PAUSED_TO_READY ||
      (transition == GST_STATE_CHANGE_READY_TO_PAUSED && result == GST_STATE_CHANGE_FAILURE))
    finish_recording(self);
  if (transition == GST_STATE_CHANGE_READY_TO_NULL ||
      (transition == GST_STATE_CHANGE_NULL_TO_READY && result == GST_STATE_CHANGE_FAILURE))
    remove_cameras(self);
  return result;
}

static void lf_camera_node_set_property(GObject* object, guint id, const GValue* value, GParamSpec* pspec) {
  LfCameraNode* self = LF_CAMERA_NODE(object);
  if (lf::is_proxy(pspec)) {
    if (self->fragment) g_object_set_property(G_OBJECT(self->fragment), pspec->name, value);
    return;
  }
  if (lf::is_named(pspec, "rig")) return lf_camera_node_set_rig(self, g_value_get_string(value));
  Properties::set(object, id, value, pspec);
}

static void lf_camera_node_get_property(GObject* object, guint id, GValue* value, GParamSpec* pspec) {
  LfCameraNode* self = LF_CAMERA_NODE(object);
  if (lf::is_proxy(pspec)) {
    if (self->fragment) g_object_get_property(G_OBJECT(self->fragment), pspec->name, value);
    return;
  }
  Properties::get(object, id, value, pspec);
}

static void lf_camera_node_finalize(GObject* object) {
  LfCameraNode* self = LF_CAMERA_NODE(object);
  delete self->settings;
  delete self->opened;
  delete self->rig;
  delete self->cameras;
  delete self->recording;
  G_OBJECT_CLASS(lf_camera_node_parent_class)->finalize(object);
}

static GstPad* add_ghost_pad(LfCameraNode* self, const char* name, GstStaticPadTemplate* static_template) {
  g_autoptr(GstPadTemplate) pad_template = gst_static_pad_template_get(static_template);
  g_autoptr(GstPad) target = self->fragment ? gst_element_get_static_pad(self->fragment, name) : nullptr;
  GstPad* pad = target ? gst_ghost_pad_new_from_template(name, target, pad_template)
                       : gst_ghost_pad_new_no_target_from_template(name, pad_template);
  if (GST_PAD_IS_SINK(pad)) lf::accept_unit_caps(pad);
  gst_element_add_pad(GST_ELEMENT(self), pad);
  return pad;
}

// lffragment adds and removes the source pad together with the request pad.
static GstPad* lf_camera_node_new_pad(GstElement* element, GstPadTemplate*, const gchar* name, const GstCaps*) {
  LfCameraNode* self = LF_CAMERA_NODE(element);
  if (!self->fragment) return nullptr;
  g_autoptr(GstPad) target = gst_element_request_pad_simple(self->fragment, name ? name : "request_%u");
  if (!target) return nullptr;
  const std::string request_name = GST_PAD_NAME(target);
  const std::string src_name = "src" + request_name.substr(sizeof("request") - 1);
  gst_pad_set_active(add_ghost_pad(self, src_name.c_str(), &more_src_template), TRUE);
  GstPad* pad = add_ghost_pad(self, request_name.c_str(), &more_request_template);
  gst_pad_set_active(pad, TRUE);
  return pad;
}

static void lf_camera_node_release_pad(GstElement* element, GstPad* pad) {
  LfCameraNode* self = LF_CAMERA_NODE(element);
  const std::string src_name = "src" + std::string(GST_PAD_NAME(pad)).substr(sizeof("request") - 1);
  g_autoptr(GstPad) target = gst_ghost_pad_get_target(GST_GHOST_PAD(pad));
  g_autoptr(GstPad) src = gst_element_get_static_pad(element, src_name.c_str());
  for (GstPad* removed : {src, pad}) {
    if (!removed) continue;
    gst_pad_set_active(removed, FALSE);
    gst_element_remove_pad(element, removed);
  }
  if (target) gst_element_release_request_pad(self->fragment, target);
}

static void lf_camera_node_class_init(LfCameraNodeClass* klass) {
  GObjectClass* object_class = G_OBJECT_CLASS(klass);
  object_class->finalize = lf_camera_node_finalize;

  const guint next_id = Properties::install(
      object_class,
      "Counters of lffragment, and a structure for each camera. In this structure, state is opening, running, ended, "
      "lost or stopped, and reason describes the latest loss. losses counts the losses, retries counts the attempts to "
      "reopen the camera, and dropped counts skipped frames. capture-time names the origin of the capture times, as in "
      "the `stats` of lfcamsrc. During a recording, the structure also contains the numbers of recorded and unrecorded "
      "frames. The structure recording then contains folder, begin (clock time of timestamp 0 for live frames) and "
      "reason (if the recording has ended)");
  object_class->set_property = lf::callback<lf_camera_node_set_property>;
  object_class->get_property = lf::callback<lf_camera_node_get_property>;
  lf::install_proxies(object_class, next_id, LF_TYPE_FRAGMENT, {"rig", "node", "stats"});

  GstElementClass* element_class = GST_ELEMENT_CLASS(klass);
  element_class->change_state = lf::callback<lf_camera_node_change_state>;
  GST_BIN_CLASS(klass)->handle_message = lf::callback<lf_camera_node_handle_message>;
  element_class->request_new_pad = lf::callback<lf_camera_node_new_pad>;
  element_class->release_pad = lf::callback<lf_camera_node_release_pad>;
  gst_element_class_add_static_pad_template(element_class, &request_template);
  gst_element_class_add_static_pad_template(element_class, &more_request_template);
  gst_element_class_add_static_pad_template(element_class, &src_template);
  gst_element_class_add_static_pad_template(element_class, &more_src_template);
  gst_element_class_set_static_metadata(element_class, "Light field camera node", "Filter/Video",
                                        "Answers view requests with the weighted sum of the images of its cameras. "
                                        "This bin contains one lfcamsrc per camera and one lffragment",
                                        "gst-lightfield");
}

static void lf_camera_node_init(LfCameraNode* self) {
  self->settings = new Settings;
  self->opened = new Settings;
  self->rig = new std::shared_ptr<const lf::Rig>;
  self->cameras = new std::vector<GstElement*>;
  self->recording = new std::shared_ptr<lf::Recording>;
  // The output of the node ends when its requests end, so an EOS event must not reach the cameras. The node must not
  // provide the clock of the pipeline either, even if one of its cameras could.
  gst_bin_set_suppressed_flags(
      GST_BIN(self),
      static_cast<GstElementFlags>(GST_ELEMENT_FLAG_SOURCE | GST_ELEMENT_FLAG_SINK | GST_ELEMENT_FLAG_PROVIDE_CLOCK));
  self->fragment = gst_element_factory_make("lffragment", "fragment");
  if (self->fragment) gst_bin_add(GST_BIN(self), self->fragment);
  add_ghost_pad(self, "request", &request_template);
  add_ghost_pad(self, "src", &src_template);
}
