// SPDX-License-Identifier: LGPL-2.1-or-later

/**
 * SECTION:element-lfcameranode
 * @title: lfcameranode
 * @short_description: the cameras of a rig, or some of them, as one node that answers view requests
 *
 * A bin of one #element-lfcamsrc for each camera of a list and one #element-lffragment. View requests come in on
 * `request`, an answer for each goes out on `src`. Further requesters, such as compositors on other hosts, have pads of
 * their own: what comes in on `request_0` is answered on `src_0`.
 *
 * A camera that fails ends nothing: its neighbours close the gap. Live ones are opened again until they are back
 * (`retry`), others are lost for good. #element-lfcamsrc tells which with its messages, `stats` have the state, the
 * reason and the retries of each. An error it is where no camera has worked, or none is opened again.
 *
 * With `record` what the cameras give is on disk when the node stops, the views to be chosen later: the folder has a
 * Matroska file for each of them and a rig.json, which this element plays as any other, with the same capture times.
 * JPEG, H.264, H.265, VP8, VP9 and AV1 stay as they come; raw video is encoded as JPEG of quality 95. A disk that is
 * too slow, or full, costs frames of the recording (`stats`), and neither cameras nor viewers. After a crash the files
 * can be played up to then.
 *
 * ## Example launch lines
 * |[
 * gst-launch-1.0 lfviewrequest location=views.json ! tee name=r  r. ! queue ! n.request \
 *   lfcameranode name=n rig=rig.json ! c.sink_0  r. ! queue ! c.request \
 *   lfcompositor name=c rig=rig.json ! videoconvert ! pngenc ! multifilesink location=out_%02d.png
 * ]|
 * |[
 * gst-launch-1.0 lfcameranode rig=rig.json is-live=true loop=true record=recording
 * ]| Records all cameras until Ctrl-C.
 *
 * ## Element messages
 * Those of its cameras; and "lightfield-no-camera" when the last one that worked is lost and some are opened again:
 * cameras (uint: how many there are), reason (string: those of all), beside one warning. The next
 * "lightfield-camera-found" ends that. "lightfield-recording-stopped" when no more is recorded, as the disk is full:
 * folder, reason (strings), beside one warning.
 */

#include "bins/lfcameranode.h"

#include <algorithm>
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
#include "bins/property_copy.h"
#include "camsrc/lfcamsrc.h"
#include "common/common.h"
#include "common/gst_pointers.h"
#include "common/guard.h"
#include "common/properties.h"
#include "fragment/lffragment.h"
#include "recording/recording.h"
#include "rig/rig.h"

GST_DEBUG_CATEGORY_STATIC(lf_camera_node_debug);
#define GST_CAT_DEFAULT lf_camera_node_debug

namespace lf {
namespace {

// lfcameranode's properties, but for those that are its lffragment's.
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
      property<&S::rig>(kWhilePlaying, "rig", "Rig",
                        "Path of the rig file (rig.json) of the whole array. Set while running, it is read again and "
                        "serves from the next request on, if it has the same cameras with the same sources; time "
                        "offsets count from the next start on"),
      property<&S::cameras>(kWhileReady, "cameras", "Cameras",
                            "Ids of the cameras of this node, such as \"0-15,20\" (empty = all of the rig)", ""),
      fraction_property<&S::fps_n, &S::fps_d>(
          kWhileReady, "framerate", "Frame rate",
          "Frames per second of each camera (0/1 = as its source has them, 15/1 where that has none)", 0, 1),
      property<&S::is_live>(kWhileReady, "is-live", "Is live",
                            "Frames come at their time on the pipeline's clock, in place of when a request needs them"),
      property<&S::loop>(kWhileReady, "loop", "Loop", "Videos and image sequences begin again at their end"),
      property<&S::node>(kWhileReady, "node", "Node",
                         "Number of this node in its answers; each node of an array has its own", 0u, G_MAXUINT),
      property<&S::decode>(kWhileReady, "decode", "Decode",
                           "JPEG video is decoded frame by frame, in place of where a request looks, and what is in a "
                           "graphics card's memory is copied to the computer's"),
      property<&S::latency>(kWhileReady, "latency", "Latency",
                            "Network cameras (RTSP): how long packets are waited for and put in order, in nanoseconds",
                            guint64{0}, guint64{60 * GST_SECOND}),
      property<&S::retry>(kWhileReady, "retry", "Retry",
                          "Live cameras that fail are opened again, after half a second at first and after ten seconds "
                          "at most; else they are lost for good, as files are that are not live"),
      property<&S::record>(kWhileReady, "record", "Record",
                           "Folder that the cameras are recorded into from the start to the stop, with a rig.json to "
                           "play them by; it must not have one already (none: not recorded)"),
      property<&S::trusted>(kWhileReady, "trusted", "Trusted",
                            "Whether the rig file may run any element: without it, sources that describe elements can "
                            "have sources, converters and decoders of a short list only"),
  };
  return table;
}

constexpr std::string_view kColon = ": ";
constexpr size_t kAlone = 3;  // reasons that are told one by one

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
    if (count == 0) continue;  // told with the first of them
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
  GstElement* fragment;                 // borrowed from the bin's children; null where lffragment is not installed
  Settings* settings;                   // under the object lock
  Settings* opened;                     // what the children were made for
  std::shared_ptr<const lf::Rig>* rig;  // the same
  std::vector<GstElement*>* cameras;    // borrowed from the bin's children; under the object lock
  std::shared_ptr<lf::Recording>* recording;  // null where nothing is recorded; under the object lock
  bool failed;                                // no camera works, which ends the node; under the object lock
  bool none_works;                            // no camera works for now, and that has been told; the same
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

// Null where nothing is recorded.
static std::shared_ptr<lf::Recording> recording_of(LfCameraNode* self) {
  const lf::ObjectLock lock(self);
  return *self->recording;
}

// A camera that has just been made: what it gives is recorded while there is a recording. Both outlive its streams.
static void tap_camera(LfCameraNode* self, GstElement* element, guint id) {
  LfCamSrc* camera = LF_CAM_SRC(element);
  lf_cam_src_set_keeper(camera, [=](GstBuffer* buffer, GstCaps* caps, GstClockTime captured) {
    const std::shared_ptr<lf::Recording> recording = recording_of(self);
    if (recording) recording->add(id, buffer, caps, captured, lf_cam_src_is_live(camera));
  });
}

// From now on, between two starts, its cameras are recorded, if its property says so. False, after posting the reason,
// where they can't be.
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

// When they have stopped.
static void finish_recording(LfCameraNode* self) {
  const std::shared_ptr<lf::Recording> recording = recording_of(self);
  if (!recording) return;
  recording->finish();
  const lf::ObjectLock lock(self);
  self->recording->reset();
}

static std::vector<lf::ElementPtr> hold_cameras(LfCameraNode* self) {
  std::vector<lf::ElementPtr> cameras;
  lf::ObjectLock lock(self);
  for (GstElement* camera : *self->cameras) cameras.emplace_back(GST_ELEMENT(gst_object_ref(camera)));
  lock.unlock();
  return cameras;
}

namespace {

// Of a node none of whose cameras works.
struct Losses {
  bool has_worked = false, for_good = true;
  std::vector<std::string> reasons;
};

}  // namespace

// Nothing where a camera works, or is still being opened for the first time.
static std::optional<Losses> losses_of(LfCameraNode* self) {
  Losses losses;
  for (const lf::ElementPtr& camera : hold_cameras(self)) {
    const lf::CameraService::Report report = lf_cam_src_service(LF_CAM_SRC(camera.get())).report();
    if (report.state != lf::CameraService::State::kLost) return std::nullopt;
    losses.has_worked = losses.has_worked || report.worked;
    losses.for_good = losses.for_good && lf_cam_src_is_lost_for_good(LF_CAM_SRC(camera.get()));
    losses.reasons.push_back(report.reason);
  }
  return losses;
}

static bool exchange_flag(LfCameraNode* self, bool* flag, bool value) {
  GST_OBJECT_LOCK(self);
  const bool before = std::exchange(*flag, value);
  GST_OBJECT_UNLOCK(self);
  return before;
}

// A camera is back. Any thread.
static void note_found(LfCameraNode* self) { exchange_flag(self, &self->none_works, false); }

// All of them may come back.
static void tell_none_works(LfCameraNode* self, const Losses& losses) {
  if (exchange_flag(self, &self->none_works, true)) return;
  // One that came back before the line above has not been noticed by it.
  if (!losses_of(self)) return note_found(self);
  const std::string reasons = lf::grouped_reasons(losses.reasons, "; ");
  GstStructure* structure =
      gst_structure_new(LF_NO_CAMERA, "cameras", G_TYPE_UINT, static_cast<guint>(losses.reasons.size()), "reason",
                        G_TYPE_STRING, reasons.c_str(), nullptr);
  gst_element_post_message(GST_ELEMENT(self), gst_message_new_element(GST_OBJECT(self), structure));
  GST_ELEMENT_WARNING(self, RESOURCE, NOT_FOUND, ("No camera works any more: %s", reasons.c_str()), (nullptr));
}

// A camera has been lost: if none works any more that is an error, or where one has worked before and some may come
// back a warning and an element message, once until one is back. Any thread.
static void check_cameras(LfCameraNode* self) {
  const std::optional<Losses> losses = losses_of(self);
  if (!losses) return;
  if (losses->has_worked && !losses->for_good) return tell_none_works(self, *losses);
  if (exchange_flag(self, &self->failed, true)) return;
  GST_ELEMENT_ERROR(self, RESOURCE, NOT_FOUND,
                    ("No camera works:\n%s", lf::grouped_reasons(losses->reasons, "\n").c_str()), (nullptr));
}

// Waits, for a limited time, until each camera has a first frame or is lost. Then has_failed() tells of an error at the
// start.
static void wait_for_cameras(LfCameraNode* self) {
  constexpr uint64_t kPatience = 2'000'000'000;
  const auto is_opening = [](const lf::ElementPtr& camera) {
    return lf_cam_src_service(LF_CAM_SRC(camera.get())).state() == lf::CameraService::State::kOpening;
  };
  const std::vector<lf::ElementPtr> cameras = hold_cameras(self);
  for (const uint64_t end = lf::now_ns() + kPatience; lf::now_ns() < end && std::ranges::any_of(cameras, is_opening);)
    g_usleep(1000);
  check_cameras(self);  // a loss is noted before it is told
}

// Whether the error that no camera works has been posted since it was forgotten.
static bool has_failed(LfCameraNode* self) {
  GST_OBJECT_LOCK(self);
  const bool failed = self->failed;
  GST_OBJECT_UNLOCK(self);
  return failed;
}

static void forget_failure(LfCameraNode* self) {
  GST_OBJECT_LOCK(self);
  self->failed = self->none_works = false;
  GST_OBJECT_UNLOCK(self);
}

// The `stats` property: what lffragment counts, and the structure `cameras` of one for each, camera-ID. Owned by the
// caller.
static GstStructure* stats_of(LfCameraNode* self) {
  GstStructure* stats = nullptr;
  if (self->fragment) g_object_get(self->fragment, "stats", &stats, nullptr);
  if (!stats) stats = gst_structure_new_empty("lightfield-fragment-stats");
  g_autoptr(GstStructure) cameras = gst_structure_new_empty("lightfield-cameras");
  const std::shared_ptr<lf::Recording> recording = recording_of(self);
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
  GST_OBJECT_LOCK(self);
  const std::vector<GstElement*> cameras = std::exchange(*self->cameras, {});
  GST_OBJECT_UNLOCK(self);
  for (GstElement* camera : cameras) {
    GstPad* src = gst_element_get_static_pad(camera, "src");
    GstPad* sink = gst_pad_get_peer(src);
    gst_element_set_state(camera, GST_STATE_NULL);
    gst_bin_remove(GST_BIN(self), camera);
    if (sink) {
      gst_element_release_request_pad(self->fragment, sink);
      gst_object_unref(sink);
    }
    gst_object_unref(src);
  }
}

// The pad is named after the camera's index, which is easily found in a picture of the pipeline.
static void add_camera(LfCameraNode* self, const Settings& settings, const lf::Rig& rig, lf::CameraIndex index) {
  const std::string id = std::to_string(rig.cameras[index].id);
  GstElement* camera = gst_element_factory_make("lfcamsrc", ("camera" + id).c_str());
  if (!camera) throw lf::Error("element lfcamsrc is not installed");
  g_object_set(camera, "rig", settings.rig.c_str(), "camera", rig.cameras[index].id, "is-live", settings.is_live,
               "loop", settings.loop, "decode", settings.decode, "latency", settings.latency, "retry", settings.retry,
               "trusted", settings.trusted, nullptr);
  lf_cam_src_set_expendable(LF_CAM_SRC(camera));
  gst_util_set_object_arg(G_OBJECT(camera), "framerate",
                          (std::to_string(settings.fps_n) + "/" + std::to_string(settings.fps_d)).c_str());
  {
    const lf::ObjectLock lock(self);
    self->cameras->reserve(self->cameras->size() + 1);  // none is in the bin that is not known
  }
  if (!settings.record.empty()) tap_camera(self, camera, rig.cameras[index].id);
  gst_bin_add(GST_BIN(self), camera);
  lf::ObjectLock lock(self);
  self->cameras->push_back(camera);
  lock.unlock();
  if (!gst_element_link_pads(camera, "src", self->fragment, ("sink_" + std::to_string(index)).c_str()))
    throw lf::Error(settings.rig + ": camera " + id + ": can't be linked with lffragment");
  gst_child_proxy_set(GST_CHILD_PROXY(self->fragment), ("sink_" + std::to_string(index) + "::camera").c_str(),
                      static_cast<gint>(rig.cameras[index].id), nullptr);
}

// False, without cameras, after posting the reason.
static bool open_cameras(LfCameraNode* self) {
  remove_cameras(self);
  const Settings settings = current_settings(self);
  try {
    if (!self->fragment) throw lf::Error("element lffragment is not installed");
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
    return true;
  } catch (const std::exception& error) {
    GST_ELEMENT_ERROR(self, RESOURCE, SETTINGS, ("%s", error.what()), (nullptr));
  }
  remove_cameras(self);
  return false;
}

// Whether the rig has the same cameras with the same sources as the one that the cameras were opened with; else
// *problem says what is not.
static bool has_same_sources(LfCameraNode* self, const lf::Rig& rig, std::string* problem) {
  const lf::Rig& before = **self->rig;
  const auto place = [](const lf::Rig& of, const std::string& path) {
    return lf::is_uri(path) ? path : std::filesystem::path(of.resolve(path)).lexically_normal().string();
  };
  try {
    std::vector<lf::CameraIndex> own = lf::parse_camera_list(before, self->opened->cameras);
    if (lf::parse_camera_list(rig, self->opened->cameras).size() != own.size())
      throw lf::Error("it has another number of cameras");
    for (const lf::CameraIndex index : own) {
      const lf::Camera& was = before.cameras[index];
      const auto is = rig.index_of_id(was.id);
      if (!is) throw lf::Error("it has no camera " + std::to_string(was.id));
      const lf::Camera& now = rig.cameras[*is];
      if (place(before, was.source) != place(rig, now.source) || place(before, was.image) != place(rig, now.image))
        throw lf::Error("camera " + std::to_string(was.id) + " has another source");
    }
    return true;
  } catch (const lf::Error& error) {
    *problem = error.what();
    return false;
  }
}

// While the node runs lffragment takes the new rig, and the cameras go on as they are.
static void lf_camera_node_set_rig(LfCameraNode* self, const gchar* path) {
  if (lf::is_running(GST_ELEMENT(self))) {
    const std::shared_ptr<const lf::Rig> rig = lf::reload_rig(GST_ELEMENT(self), path);
    if (!rig) return;
    std::string problem;
    if (!has_same_sources(self, *rig, &problem)) {
      GST_ELEMENT_WARNING(
          self, RESOURCE, SETTINGS,
          ("%s: %s: such a rig needs this node to be started anew; the rig stays as it was.", path, problem.c_str()),
          (nullptr));
      return;
    }
    g_object_set(self->fragment, "rig", path, nullptr);
    if (const auto recording = recording_of(self)) recording->take_rig(*rig, path);
  }
  lf::ObjectLock lock(self);
  self->settings->rig = path ? path : "";
  lock.unlock();
}

static void lf_camera_node_handle_message(GstBin* bin, GstMessage* message) {
  const GstStructure* structure =
      GST_MESSAGE_TYPE(message) == GST_MESSAGE_ELEMENT ? gst_message_get_structure(message) : nullptr;
  const bool is_loss = structure && gst_structure_has_name(structure, LF_CAMERA_LOST);
  if (structure && gst_structure_has_name(structure, LF_CAMERA_FOUND)) note_found(LF_CAMERA_NODE(bin));
  GST_BIN_CLASS(lf_camera_node_parent_class)->handle_message(bin, message);
  if (is_loss) check_cameras(LF_CAMERA_NODE(bin));
}

static GstStateChangeReturn lf_camera_node_change_state(GstElement* element, GstStateChange transition) {
  LfCameraNode* self = LF_CAMERA_NODE(element);
  const bool stale = transition == GST_STATE_CHANGE_NULL_TO_READY ||
                     (transition == GST_STATE_CHANGE_READY_TO_PAUSED && *self->opened != current_settings(self));
  if (stale && !open_cameras(self)) return GST_STATE_CHANGE_FAILURE;
  const bool starts = transition == GST_STATE_CHANGE_NULL_TO_READY || transition == GST_STATE_CHANGE_READY_TO_PAUSED;
  if (starts) forget_failure(self);
  if (transition == GST_STATE_CHANGE_READY_TO_PAUSED && !start_recording(self)) return GST_STATE_CHANGE_FAILURE;
  GstStateChangeReturn result = GST_ELEMENT_CLASS(lf_camera_node_parent_class)->change_state(element, transition);
  if (transition == GST_STATE_CHANGE_READY_TO_PAUSED && !self->opened->is_live && result == GST_STATE_CHANGE_SUCCESS)
    wait_for_cameras(self);
  if (starts && has_failed(self)) result = GST_STATE_CHANGE_FAILURE;
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
  if (lf::is_copy(pspec)) {
    if (self->fragment) g_object_set_property(G_OBJECT(self->fragment), pspec->name, value);
    return;
  }
  if (lf::is_named(pspec, "rig")) return lf_camera_node_set_rig(self, g_value_get_string(value));
  Properties::set(object, id, value, pspec);
}

static void lf_camera_node_get_property(GObject* object, guint id, GValue* value, GParamSpec* pspec) {
  LfCameraNode* self = LF_CAMERA_NODE(object);
  if (lf::is_copy(pspec)) {
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
  GstPadTemplate* pad_template = gst_static_pad_template_get(static_template);
  GstPad* target = self->fragment ? gst_element_get_static_pad(self->fragment, name) : nullptr;
  GstPad* pad = target ? gst_ghost_pad_new_from_template(name, target, pad_template)
                       : gst_ghost_pad_new_no_target_from_template(name, pad_template);
  if (GST_PAD_IS_SINK(pad)) lf::accept_unit_caps(pad);
  gst_element_add_pad(GST_ELEMENT(self), pad);
  gst_clear_object(&target);
  gst_object_unref(pad_template);
  return pad;
}

// lffragment adds the source pad with the request pad and takes it away with it.
static GstPad* lf_camera_node_new_pad(GstElement* element, GstPadTemplate*, const gchar* name, const GstCaps*) {
  LfCameraNode* self = LF_CAMERA_NODE(element);
  if (!self->fragment) return nullptr;
  GstPad* target = gst_element_request_pad_simple(self->fragment, name ? name : "request_%u");
  if (!target) return nullptr;
  const std::string request_name = GST_PAD_NAME(target);
  const std::string src_name = "src" + request_name.substr(sizeof("request") - 1);
  gst_object_unref(target);
  gst_pad_set_active(add_ghost_pad(self, src_name.c_str(), &more_src_template), TRUE);
  GstPad* pad = add_ghost_pad(self, request_name.c_str(), &more_request_template);
  gst_pad_set_active(pad, TRUE);
  return pad;
}

static void lf_camera_node_release_pad(GstElement* element, GstPad* pad) {
  LfCameraNode* self = LF_CAMERA_NODE(element);
  const std::string src_name = "src" + std::string(GST_PAD_NAME(pad)).substr(sizeof("request") - 1);
  GstPad* target = gst_ghost_pad_get_target(GST_GHOST_PAD(pad));
  if (GstPad* src = gst_element_get_static_pad(element, src_name.c_str())) {
    gst_pad_set_active(src, FALSE);
    gst_element_remove_pad(element, src);
    gst_object_unref(src);
  }
  gst_pad_set_active(pad, FALSE);
  gst_element_remove_pad(element, pad);
  if (!target) return;
  gst_element_release_request_pad(self->fragment, target);
  gst_object_unref(target);
}

static void lf_camera_node_class_init(LfCameraNodeClass* klass) {
  GObjectClass* object_class = G_OBJECT_CLASS(klass);
  object_class->finalize = lf_camera_node_finalize;

  const guint next_id = Properties::install(
      object_class,
      "What lffragment counts, see there, and of each of the cameras: state (opening, running, ended, "
      "lost or stopped), reason of the latest loss, losses, retries, dropped frames, capture-time; while it records "
      "also how many frames were recorded and how many not (unrecorded), and in recording: folder, begin (clock time "
      "that live frames in it count from), reason why it has stopped");
  object_class->set_property = lf::callback<lf_camera_node_set_property>;
  object_class->get_property = lf::callback<lf_camera_node_get_property>;
  // How lffragment answers is its own property under the same name.
  lf::install_copies(object_class, next_id, LF_TYPE_FRAGMENT, {"rig", "node", "stats"});

  GstElementClass* element_class = GST_ELEMENT_CLASS(klass);
  element_class->change_state = lf::callback<lf_camera_node_change_state>;
  GST_BIN_CLASS(klass)->handle_message = lf::callback<lf_camera_node_handle_message>;
  element_class->request_new_pad = lf::callback<lf_camera_node_new_pad>;
  element_class->release_pad = lf::callback<lf_camera_node_release_pad>;
  gst_element_class_add_static_pad_template(element_class, &request_template);
  gst_element_class_add_static_pad_template(element_class, &more_request_template);
  gst_element_class_add_static_pad_template(element_class, &src_template);
  gst_element_class_add_static_pad_template(element_class, &more_src_template);
  gst_element_class_set_static_metadata(
      element_class, "Light field camera node", "Filter/Video",
      "Answers view requests with the sum of a range of cameras: an lfcamsrc each and one lffragment",
      "gst-lightfield");
}

static void lf_camera_node_init(LfCameraNode* self) {
  self->settings = new Settings;
  self->opened = new Settings;
  self->rig = new std::shared_ptr<const lf::Rig>;
  self->cameras = new std::vector<GstElement*>;
  self->recording = new std::shared_ptr<lf::Recording>;
  // It answers requests: their end, not an EOS event to its cameras, is the end of its output.
  // It is never the clock of a pipeline, whatever its cameras have.
  gst_bin_set_suppressed_flags(
      GST_BIN(self),
      static_cast<GstElementFlags>(GST_ELEMENT_FLAG_SOURCE | GST_ELEMENT_FLAG_SINK | GST_ELEMENT_FLAG_PROVIDE_CLOCK));
  self->fragment = gst_element_factory_make("lffragment", "fragment");
  if (self->fragment) gst_bin_add(GST_BIN(self), self->fragment);
  add_ghost_pad(self, "request", &request_template);
  add_ghost_pad(self, "src", &src_template);
}
