// SPDX-License-Identifier: LGPL-2.1-or-later

/**
 * SECTION:element-lfcamsrc
 * @title: lfcamsrc
 * @short_description: one camera of a rig as a video source
 *
 * lfcamsrc delivers the video of one camera of a rig file. #element-lfcameranode contains one lfcamsrc per camera; use
 * lfcamsrc alone to look at a single camera.
 *
 * The element opens the first of these inputs that the rig file has:
 *
 * 1. `source` of the camera: a video file, an image sequence (`dir/frame_%04d.jpg`, from 0 or 1), a file of
 *    concatenated JPEG images, any GStreamer URI, or a launch description
 *    (`libcamerasrc camera-name=a ! video/x-raw,width=640`);
 * 2. `image` of the camera, a still;
 * 3. the built-in scene, rendered with the pose and lens of the camera.
 *
 * RGB formats and I420 are delivered as decoded; other formats are converted. Every frame must have the size in the
 * rig, otherwise the element posts an error. If `decode=false`, JPEG video stays JPEG, and GPU frames stay in GPU
 * memory if downstream accepts GPU memory.
 *
 * Devices and launch descriptions must deliver the size in the rig, and `framerate` if that is set. A launch
 * description may contain sources, converters and decoders from a fixed list. Other elements could write files or run
 * programs, so they require `trusted=true`. A view of another light field (`lf:///path/of/rig.json`) requires it, too.
 *
 * Messages and `stats` show the locations of sources without user names and passwords.
 *
 * If the rig lists `controls` of the camera, such as exposure time, the element sets them before it opens the device.
 *
 * The stream carries the sticky event `lightfield-camera` with the camera index and the rig hash, a checksum of the
 * rig. Each frame has a #GstReferenceTimestampMeta of `timestamp/x-lightfield-capture` with its capture time. For
 * live sources, this is clock time; for all others, stream time. The time offset of the camera in the rig is added.
 *
 * RTSP cameras report capture times in RTCP sender reports. The element uses these times if they are plausible, so
 * synchronise the clock of the camera with this machine (NTP). Until the first report, the capture time is the arrival
 * time. The field `capture-time` of `stats` shows the method.
 *
 * Motion JPEG over HTTP (`http://HOST/stream`, multipart/x-mixed-replace) is live, with the arrival time as capture
 * time.
 *
 * Video files are rotated as their metadata requires (matrix of an MP4). EXIF orientations of images are ignored with a
 * warning, as in COLMAP, because the calibration applies to unrotated images. A damaged still and a missing file of a
 * sequence are errors. A damaged image of a sequence, or a truncated JPEG picture, is skipped and counted in the field
 * `damaged` of `stats`.
 *
 * If `retry` is set, a camera that fails, is missing or ends unexpectedly does not end the stream. Instead, the element
 * reopens the camera. The delay between attempts is a quarter of the outage so far, between half a second and ten
 * seconds. Downstream receives no frames meanwhile. After the outage, a live file continues at its current position.
 *
 * ## Example launch line
 * |[
 * gst-launch-1.0 lfcamsrc rig=rig.json camera=5 ! videoconvert ! autovideosink
 * ]| Shows camera 5 in a window.
 *
 * ## Element messages
 * Posted if `retry` is set:
 *
 * - "lightfield-camera-lost": the camera has failed. Fields: camera (uint: id), name, reason (strings). The element
 *   also posts one warning.
 * - "lightfield-camera-found": the first frame after a loss. Fields: camera, name.
 */

#include "camsrc/lfcamsrc.h"

#include <algorithm>
#include <atomic>
#include <cstring>
#include <memory>
#include <string>
#include <utility>

#include <gst/video/video.h>

#include "base/schedule.h"
#include "base/text.h"
#include "camsrc/cam_src_children.h"
#include "camsrc/camera_controls.h"
#include "camsrc/picture_sources.h"
#include "common/common.h"
#include "common/gst_pointers.h"
#include "rig/source_security.h"

GST_DEBUG_CATEGORY(lf_cam_src_debug);
#define GST_CAT_DEFAULT lf_cam_src_debug

using Settings = lf::CamSrcSettings;
using State = lf::CameraLifecycle::State;

G_DEFINE_TYPE_WITH_CODE(LfCamSrc, lf_cam_src, GST_TYPE_BIN,
                        GST_DEBUG_CATEGORY_INIT(lf_cam_src_debug, "lfcamsrc", 0, "one camera of a rig as a source"))
GST_ELEMENT_REGISTER_DEFINE(lfcamsrc, "lfcamsrc", GST_RANK_NONE, LF_TYPE_CAM_SRC)

lf::PropertyTable<Settings>& Settings::properties() {
  using namespace lf;
  using S = Settings;
  static PropertyTable<S> table = {
      property<&S::rig>(kWhileReady, "rig", "Rig",
                        "Path of the rig file (rig.json), which describes the cameras of "
                        "the array: their sources, lenses and poses. This property is "
                        "required"),
      property<&S::camera>(
          kWhileReady, "camera", "Camera",
          "Id of the camera to open, as in the `id` field of the rig file. The first camera usually has the id 0", 0u,
          G_MAXUINT),
      fraction_property<&S::fps_n, &S::fps_d>(
          kWhileReady, "framerate", "Frame rate",
          "Frame rate, in frames per second. The element drops or repeats frames of videos to get this rate (0/1: "
          "rate of the source, or 15/1 for stills, image sequences and the built-in scene)",
          0, 1),
      property<&S::is_live>(
          kWhileReady, "is-live", "Is live",
          "If true, the element plays files and stills in real time, as if they were live devices. The pipeline clock "
          "then determines when each frame is output. If false, frames are output as fast as downstream consumes them, "
          "for example to convert a file. Devices and network cameras are always live"),
      property<&S::loop>(kWhileReady, "loop", "Loop",
                         "If true, videos and image sequences repeat endlessly. The running time continues across each "
                         "restart, so downstream sees one continuous stream. If false, the stream ends with the file"),
      property<&S::num_buffers>(kWhileReady, "num-buffers", "Number of frames",
                                "Length of the stream, in frames. Set this to get a short test stream from a camera or "
                                "a still (-1: the stream ends with its source, so stills and the built-in scene never "
                                "end)",
                                gint64{-1}, G_MAXINT64),
      property<&S::decode>(kWhileReady, "decode", "Decode",
                           "If true, the element decodes JPEG video and downloads GPU frames to system memory, so the "
                           "output is always raw video. If false, JPEG video and GPU frames pass unchanged. This saves "
                           "time in front of lffragment, which decodes only the regions that it needs"),
      property<&S::latency>(
          kWhileReady, "latency", "Latency",
          "Size of the jitter buffer for network cameras (RTSP), in nanoseconds. Increase it if packets of the camera "
          "arrive late and its pictures are damaged. A larger buffer delays every frame",
          guint64{0}, guint64{60 * GST_SECOND}),
      property<&S::retry>(
          kWhileReady, "retry", "Retry",
          "If true, the element reopens the camera after a failure. The first attempt follows after half a second, and "
          "the time between later attempts grows to ten seconds. The element posts the message lightfield-camera-lost "
          "at the beginning of the outage, and lightfield-camera-found at its end. If false, a failure of the camera "
          "is an error and stops the pipeline"),
      property<&S::trusted>(
          kWhileReady, "trusted", "Trusted",
          "If true, the rig file may run any GStreamer element. Set this only for rig files from people you trust. If "
          "false, launch descriptions in the rig may contain only sources, converters and decoders from a fixed list"),
  };
  return table;
}

static GstStaticPadTemplate src_template = GST_STATIC_PAD_TEMPLATE(
    "src", GST_PAD_SRC, GST_PAD_ALWAYS,
    GST_STATIC_CAPS(GST_VIDEO_CAPS_MAKE("{ " LF_RGB_FORMATS
                                        ", I420 }") "; image/jpeg; " LF_CARD_VIDEO_CAPS("{ " LF_CAMERA_FORMATS " }")));

static GstClockTime lf_cam_src_period(LfCamSrc* self) {
  g_autoptr(GstCaps) caps = gst_pad_get_current_caps(self->src);
  int fps_n = 0, fps_d = 1;
  if (caps) gst_structure_get_fraction(gst_caps_get_structure(caps, 0), "framerate", &fps_n, &fps_d);
  if (fps_n <= 0 || fps_d <= 0) return GST_SECOND / lf::kDefaultFps;
  return gst_util_uint64_scale(GST_SECOND, static_cast<guint64>(fps_d), static_cast<guint64>(fps_n));
}

bool lf_cam_src_is_live(LfCamSrc* self) { return self->live; }

void lf_cam_src_set_tap(LfCamSrc* self, const lf::RecordingTap& tap) { *self->tap = tap; }

// --- Loss and retry --------------------------------------------------------------------------------------------------
//
// A camera that may be lost is closed after a failure and reopened later. Each step runs in its own thread, because
// streaming threads must not change states. Each step holds the state lock. A step does nothing if the element was
// stopped or reopened after the step was scheduled.

static GstStructure* lf_cam_src_structure(LfCamSrc* self, const char* name) {
  const lf::ObjectLock lock(self);
  return gst_structure_new(name, "camera", G_TYPE_UINT, self->camera, "name", G_TYPE_STRING, self->name->c_str(),
                           nullptr);
}

static void lf_cam_src_post_structure(LfCamSrc* self, GstStructure* structure) {
  gst_element_post_message(GST_ELEMENT(self), gst_message_new_element(GST_OBJECT(self), structure));
}

static bool has_retry(LfCamSrc* self) {
  const lf::ObjectLock lock(self);
  return self->settings->retry;
}

static bool lf_cam_src_retries(LfCamSrc* self) {
  return has_retry(self) && (self->live || !g_atomic_int_get(&self->expendable));
}

void lf_cam_src_set_optional(LfCamSrc* self) { g_atomic_int_set(&self->expendable, TRUE); }

// Adds the current values of the camera controls. This queries the device, so do not call it for every frame.
static void lf_cam_src_add_controls(LfCamSrc* self, GstStructure* stats) {
  lf::ObjectLock lock(self);
  g_autoptr(GstElement) device = self->run ? self->run->chain.device : nullptr;
  if (device) gst_object_ref(device);
  const lf::Controls wanted = self->run ? self->run->controls : lf::Controls{};
  lock.unlock();
  g_autoptr(GstStructure) controls =
      device ? lf::read_controls(device, wanted) : gst_structure_new_empty("lightfield-controls");
  g_autoptr(GstStructure) values =
      device ? lf::read_control_values(device, wanted) : gst_structure_new_empty("lightfield-controls");
  if (!device)
    for (const auto& [name, value] : wanted) gst_structure_set(controls, name.c_str(), G_TYPE_BOOLEAN, FALSE, nullptr);
  gst_structure_set(stats, "controls", GST_TYPE_STRUCTURE, controls, "control-values", GST_TYPE_STRUCTURE, values,
                    nullptr);
}

GstStructure* lf_cam_src_stats(LfCamSrc* self, const char* name) {
  const lf::CameraLifecycle::Report report = self->service->report();
  lf::ObjectLock lock(self);
  const std::shared_ptr<lf::SenderClock> sender = self->run ? self->run->chain.sender : nullptr;
  const bool is_arrival = self->run && self->run->stream->stamps_arrivals();
  const guint64 damaged = self->run ? self->run->chain.damaged->load() : 0;
  lock.unlock();
  const char* capture_time = is_arrival ? "arrival" : "source";
  if (sender) capture_time = sender->is_known() ? "sender-reports" : "arrival";
  return gst_structure_new(name, "state", G_TYPE_STRING, lf::to_string(report.state), "reason", G_TYPE_STRING,
                           report.reason.c_str(), "losses", G_TYPE_UINT64, report.losses, "retries", G_TYPE_UINT64,
                           report.retries, "dropped", G_TYPE_UINT64, (*self->shedder)->dropped(), "damaged",
                           G_TYPE_UINT64, damaged, "capture-time", G_TYPE_STRING, capture_time, nullptr);
}

const lf::CameraLifecycle& lf_cam_src_lifecycle(LfCamSrc* self) { return *self->service; }

bool lf_cam_src_is_lost_for_good(LfCamSrc* self) {
  return self->service->state() == State::kLost && !lf_cam_src_retries(self);
}

bool lf_cam_src_may_be_lost(LfCamSrc* self) { return has_retry(self) || g_atomic_int_get(&self->expendable); }

static void lf_cam_src_post(LfCamSrc* self, GstMessageType type, const CamSrcFailure& failure, const char* more = "") {
  const std::string text = lf::redacted_location(failure.text) + more, debug = lf::redacted_location(failure.debug);
  gst_element_message_full(GST_ELEMENT(self), type, failure.domain, failure.code, g_strdup(text.c_str()),
                           debug.empty() ? nullptr : g_strdup(debug.c_str()), __FILE__, GST_FUNCTION, __LINE__);
}

void lf_cam_src_fail(LfCamSrc* self, const CamSrcFailure& failure) {
  if (!lf_cam_src_may_be_lost(self)) return lf_cam_src_post(self, GST_MESSAGE_ERROR, failure);
  const std::string reason = lf::redacted_location(failure.text);
  if (!self->service->lose(reason, lf::now_ns())) {
    GST_INFO_OBJECT(self, "not back: %s", reason.c_str());
    return;
  }
  GstStructure* lost = lf_cam_src_structure(self, LF_CAMERA_LOST);
  gst_structure_set(lost, "reason", G_TYPE_STRING, reason.c_str(), nullptr);
  lf_cam_src_post_structure(self, lost);
  lf_cam_src_post(self, GST_MESSAGE_WARNING, failure,
                  lf_cam_src_retries(self) ? ": out of service until it is back" : ": out of service from now on");
}

void lf_cam_src_post_found(LfCamSrc* self) {
  GST_INFO_OBJECT(self, "back again");
  lf_cam_src_post_structure(self, lf_cam_src_structure(self, LF_CAMERA_FOUND));
}

// Returns the stream of the open camera; null if there is none.
static std::shared_ptr<lf::CameraStream> stream_of(LfCamSrc* self) {
  const lf::ObjectLock lock(self);
  return self->run ? self->run->stream : nullptr;
}

static std::string place_of(LfCamSrc* self) {
  const std::shared_ptr<lf::CameraStream> stream = stream_of(self);
  return stream ? stream->place() : "";
}

void lf_cam_src_warn_overload(LfCamSrc* self, GstClockTimeDiff late) {
  constexpr uint64_t kQuiet = 10'000'000'000;
  static std::atomic<uint64_t> last_logged = 0;
  const uint64_t now = lf::now_ns(), before = last_logged.exchange(now);
  if (before != 0 && now - before < kQuiet) return;
  GST_ELEMENT_WARNING(
      self, STREAM, DECODE,
      ("%s: this machine is too slow to decode all frames, which are %d ms late: frames are dropped until the next key "
       "frame that can be on time",
       place_of(self).c_str(), static_cast<int>(late / GST_MSECOND)),
      ("further drops, also of other cameras, are counted in stats"));
}

void lf_cam_src_warn_truncated(LfCamSrc* self, GstClockTime lasted, GstClockTime missing) {
  const auto seconds = [](GstClockTime time) {
    return lf::format_text("%.2f", static_cast<double>(time) / GST_SECOND);
  };
  GST_ELEMENT_WARNING(self, STREAM, DECODE,
                      ("%s: the file is truncated: it ends after %s of %s s. %s, in each loop", place_of(self).c_str(),
                       seconds(lasted).c_str(), seconds(lasted + missing).c_str(),
                       self->live ? "The rest has no frames" : "The nearest frame is shown for the rest"),
                      (nullptr));
}

static void lf_cam_src_push_lost(LfCamSrc* self) { gst_pad_push_event(self->src, lf::camera_lost_event()); }

static bool lf_cam_src_is_due(LfCamSrc* self, guint serial) {
  return static_cast<guint>(g_atomic_int_get(&self->serial)) == serial && GST_STATE(self) >= GST_STATE_PAUSED &&
         GST_STATE_TARGET(self) >= GST_STATE_PAUSED;
}

// Calls `step` in a separate thread, with the state lock held. Does nothing if the camera has been closed or reopened
// in the meantime.
static void lf_cam_src_call_step(LfCamSrc* self, guint serial, void (*step)(LfCamSrc*)) {
  lf::call_async(GST_ELEMENT(self), [=] {
    GST_STATE_LOCK(self);
    lf::guarded(self, 0, [=] {
      if (lf_cam_src_is_due(self, serial)) step(self);
      return 0;
    });
    GST_STATE_UNLOCK(self);
  });
}

// Replaces the scheduled step (null: none).
static void set_timer(LfCamSrc* self, GstClockID timer) {
  lf::ObjectLock lock(self);
  GstClockID before = std::exchange(self->timer, timer);
  lock.unlock();
  if (!before) return;
  gst_clock_id_unschedule(before);
  gst_clock_id_unref(before);
}

static void lf_cam_src_call_later(LfCamSrc* self, GstClockTime delay, void (*step)(LfCamSrc*)) {
  struct Plan {
    lf::WeakRef<LfCamSrc> camera;
    guint serial;
    void (*step)(LfCamSrc*);
  };
  auto* plan = new Plan{lf::WeakRef(self), static_cast<guint>(g_atomic_int_get(&self->serial)), step};
  g_autoptr(GstClock) clock = gst_system_clock_obtain();
  GstClockID timer = gst_clock_new_single_shot_id(clock, gst_clock_get_time(clock) + delay);
  gst_clock_id_wait_async(
      timer,
      [](GstClock*, GstClockTime, GstClockID, gpointer data) -> gboolean {
        const auto* due = static_cast<const Plan*>(data);
        if (const auto camera = due->camera.get())
          lf::guarded(camera.get(), 0, [&] { return lf_cam_src_call_step(camera.get(), due->serial, due->step), 0; });
        return TRUE;
      },
      plan, [](gpointer data) { delete static_cast<Plan*>(data); });
  set_timer(self, timer);
}

static void lf_cam_src_schedule_retry(LfCamSrc* self);

static void lf_cam_src_close_lost(LfCamSrc* self) {
  lf_cam_src_close(self);
  lf_cam_src_push_lost(self);  // again: a frame may have been in flight
  lf_cam_src_schedule_retry(self);
}

// Shuts the failed camera down; see cam_src_children.h. The new thread waits for a state change in progress. It then
// sends the event LF_CAMERA_LOST without the state lock, because downstream may block the frames of a file until a
// request arrives.
void lf_cam_src_shut_down(LfCamSrc* self, guint serial) {
  if (!lf_cam_src_may_be_lost(self)) return;
  lf::call_async(GST_ELEMENT(self), [=] {
    GST_STATE_LOCK(self);
    const bool is_due = lf_cam_src_is_due(self, serial);
    GST_STATE_UNLOCK(self);
    if (!is_due) return;
    lf_cam_src_push_lost(self);
    // Without retry the children stay, because frames in flight still arrive.
    if (lf_cam_src_retries(self)) lf_cam_src_call_step(self, serial, lf_cam_src_close_lost);
  });
}

// Detects an outage that causes no error, such as an unplugged network cable: the camera counts as lost if nothing
// arrives for some time.
static void lf_cam_src_look_for_frames(LfCamSrc* self) {
  if (!self->run || self->service->state() == State::kEnded) return;
  constexpr uint64_t kLongestGap = 5'000'000'000, kLongestStart = 20'000'000'000;
  const uint64_t now = lf::now_ns(), frames = self->run->stream->frames_seen();
  const uint64_t activity = frames + (*self->shedder)->dropped();
  const GstClockTime time = gst_element_get_current_running_time(GST_ELEMENT(self));
  const bool is_waiting = GST_CLOCK_TIME_IS_VALID(time) && time < self->run->stream->due();
  if (GST_STATE(self) != GST_STATE_PLAYING || activity != self->activity || is_waiting) {
    self->activity = activity;
    self->active = now;
  }
  const uint64_t longest = frames > 0 ? std::max<uint64_t>(kLongestGap, 5 * lf_cam_src_period(self)) : kLongestStart;
  if (now - self->active < longest) return lf_cam_src_call_later(self, GST_SECOND, lf_cam_src_look_for_frames);
  if (!self->run->stream->first_error()) return;
  lf_cam_src_fail(
      self,
      {GST_RESOURCE_ERROR, GST_RESOURCE_ERROR_READ,
       self->run->stream->place() + ": no frame for " + std::to_string((now - self->active) / GST_SECOND) + " s", ""});
  lf_cam_src_shut_down(self, static_cast<guint>(g_atomic_int_get(&self->serial)));
}

static void lf_cam_src_watch(LfCamSrc* self) {
  // Limited to nodes, because other downstream elements may block the camera for any time.
  if (!self->live || !self->run || !g_atomic_int_get(&self->expendable)) return;
  self->active = lf::now_ns();
  lf_cam_src_call_later(self, GST_SECOND, lf_cam_src_look_for_frames);
}

static void lf_cam_src_fail_to_start(LfCamSrc* self) {
  if (self->run->stream->first_error())
    lf_cam_src_fail(
        self, {GST_CORE_ERROR, GST_CORE_ERROR_STATE_CHANGE, self->run->stream->place() + ": can't be started", ""});
  g_atomic_int_inc(&self->serial);  // errors of these children are already reported
  lf_cam_src_close(self);
  if (GST_STATE(self) >= GST_STATE_PAUSED) lf_cam_src_push_lost(self);
  lf_cam_src_schedule_retry(self);
}

static void lf_cam_src_try_again(LfCamSrc* self) {
  if (self->service->state() != State::kLost || self->run) return;
  self->service->retry();
  GST_INFO_OBJECT(self, "trying again");
  std::unique_ptr<CamSrcFailure> failure;
  lf_cam_src_open(self, &failure);
  if (failure) {
    lf_cam_src_fail(self, *failure);
    return lf_cam_src_schedule_retry(self);
  }
  GstBin* bin = GST_BIN(self);
  self->run->used = true;
  lf_cam_src_start_tail(self->run->chain);
  GstStateChangeReturn result = lf::set_child_states(bin, GST_STATE_PAUSED, false);
  if (result == GST_STATE_CHANGE_NO_PREROLL) {
    self->live = true;
    self->run->stream->set_live();
  }
  if (result != GST_STATE_CHANGE_FAILURE && GST_STATE_TARGET(self) == GST_STATE_PLAYING)
    result = lf::set_child_states(bin, GST_STATE_PLAYING, false);
  if (result == GST_STATE_CHANGE_FAILURE) return lf_cam_src_fail_to_start(self);
  lf_cam_src_watch(self);
}

static void lf_cam_src_schedule_retry(LfCamSrc* self) {
  if (lf_cam_src_retries(self)) lf_cam_src_call_later(self, self->service->wait(lf::now_ns()), lf_cam_src_try_again);
}

static void lf_cam_src_cancel_timers(LfCamSrc* self) {
  g_atomic_int_inc(&self->serial);
  set_timer(self, nullptr);
}

// Ends the stream of a lost camera. The caller holds the state lock, so another thread sends the event, unless the
// camera has been reopened by then.
static void lf_cam_src_end_lost(LfCamSrc* self) {
  lf_cam_src_cancel_timers(self);
  lf_cam_src_call_step(self, static_cast<guint>(g_atomic_int_get(&self->serial)),
                       [](LfCamSrc* camera) { gst_pad_push_event(camera->src, gst_event_new_eos()); });
}

// Adds one frame period to the latency that a live camera reports, because a frame may arrive up to one period after
// its timestamp.
static gboolean on_query(GstPad* pad, GstObject* parent, GstQuery* query) {
  if (!gst_pad_query_default(pad, parent, query)) return FALSE;
  if (GST_QUERY_TYPE(query) != GST_QUERY_LATENCY) return TRUE;
  gboolean live = FALSE;
  GstClockTime min = 0, max = GST_CLOCK_TIME_NONE;
  gst_query_parse_latency(query, &live, &min, &max);
  if (!live) return TRUE;
  min = std::max(min, lf_cam_src_period(LF_CAM_SRC(parent)));
  gst_query_set_latency(query, live, min, std::max(min, max));
  return TRUE;
}

// Opens the camera. If that fails, posts an error and returns false. If the camera may be lost, a failure is not an
// error: the function then returns true, and there are no children.
static bool open_camera(LfCamSrc* self) {
  lf_cam_src_close(self);
  self->live = false;
  self->end = self->round = 0;
  self->frames = 0;
  std::unique_ptr<CamSrcFailure> failure;
  if (!lf_cam_src_open(self, &failure)) {
    lf_cam_src_post(self, GST_MESSAGE_ERROR, *failure);
    return false;
  }
  if (!failure) return true;
  lf_cam_src_fail(self, *failure);
  return lf_cam_src_may_be_lost(self);
}

static bool is_stale(LfCamSrc* self) {
  const lf::ObjectLock lock(self);
  return !self->run || self->run->used || self->run->settings != *self->settings;
}

// Prepares the element for a state change of its children. Returns false after posting an error.
static bool prepare(LfCamSrc* self, GstStateChange transition) {
  if (transition == GST_STATE_CHANGE_NULL_TO_READY) {
    self->service->start();
    return open_camera(self);
  }
  if (transition == GST_STATE_CHANGE_READY_TO_PAUSED) {
    if (self->service->state() == State::kStopped) self->service->start();
    if (is_stale(self) && !open_camera(self)) return false;
    if (!self->run) return true;
    self->run->used = true;
    lf_cam_src_start_tail(self->run->chain);
  } else if (transition == GST_STATE_CHANGE_PAUSED_TO_READY || transition == GST_STATE_CHANGE_READY_TO_NULL) {
    lf_cam_src_cancel_timers(self);
    if (!self->run) return true;
    lf_cam_src_stop_flow(self);
  }
  return true;
}

// Changes the state of the children. A camera without children accepts any state.
static GstStateChangeReturn change_children(LfCamSrc* self, GstStateChange transition) {
  const auto chain_up = GST_ELEMENT_CLASS(lf_cam_src_parent_class)->change_state;
  const auto current = GST_STATE_TRANSITION_CURRENT(transition), next = GST_STATE_TRANSITION_NEXT(transition);
  GstStateChangeReturn result = lf::change_camera_state(GST_BIN(self), transition, chain_up);
  if (result == GST_STATE_CHANGE_FAILURE && current < next && self->run && lf_cam_src_may_be_lost(self)) {
    lf_cam_src_fail_to_start(self);
    result = lf::change_camera_state(GST_BIN(self), transition, chain_up);
  }
  const bool pausing =
      transition == GST_STATE_CHANGE_READY_TO_PAUSED || transition == GST_STATE_CHANGE_PLAYING_TO_PAUSED;
  if (!self->run && pausing && self->live && result == GST_STATE_CHANGE_SUCCESS) return GST_STATE_CHANGE_NO_PREROLL;
  return result;
}

static void lf_cam_src_begin(LfCamSrc* self) {
  if (!self->run) {
    lf_cam_src_push_lost(self);
    lf_cam_src_schedule_retry(self);
  } else if (self->run->stream->has_failed()) {
    lf_cam_src_shut_down(self, static_cast<guint>(g_atomic_int_get(&self->serial)));
  } else {
    lf_cam_src_watch(self);
  }
}

// Returns true if a source other than a device fails before its first frame. Waits for a limited time, because an error
// during the state change must fail the change. gst-launch-1.0 would miss an error directly after the change.
static bool fails_at_start(LfCamSrc* self) {
  constexpr uint64_t kStartTimeout = 2'000'000'000;
  const lf::CameraStream& stream = *self->run->stream;
  for (const uint64_t end = lf::now_ns() + kStartTimeout; lf::now_ns() < end && stream.is_opening();) g_usleep(1000);
  return stream.has_failed();
}

static GstStateChangeReturn lf_cam_src_change_state(GstElement* element, GstStateChange transition) {
  LfCamSrc* self = LF_CAM_SRC(element);
  if (!prepare(self, transition)) return GST_STATE_CHANGE_FAILURE;
  GstStateChangeReturn result = change_children(self, transition);
  if (transition == GST_STATE_CHANGE_READY_TO_PAUSED) {
    // This is early enough, because a live child produces no frame before PLAYING.
    if (result == GST_STATE_CHANGE_NO_PREROLL) {
      self->live = true;
      if (self->run) self->run->stream->set_live();
    }
    if (result != GST_STATE_CHANGE_FAILURE) lf_cam_src_begin(self);
    const bool may_wait = result == GST_STATE_CHANGE_SUCCESS && self->run && !lf_cam_src_may_be_lost(self);
    // Stops the children on the way to NULL, after the sinks, which may block the threads of the children.
    if (may_wait && fails_at_start(self)) result = GST_STATE_CHANGE_FAILURE;
  }
  if (transition == GST_STATE_CHANGE_PAUSED_TO_READY) self->service->stop();
  if (transition == GST_STATE_CHANGE_READY_TO_NULL ||
      (transition == GST_STATE_CHANGE_NULL_TO_READY && result == GST_STATE_CHANGE_FAILURE))
    lf_cam_src_close(self);
  return result;
}

// --- Messages --------------------------------------------------------------------------------------------------------

static gboolean hide_secret(GQuark /*field*/, GValue* value, gpointer /*unused*/) {
  if (G_VALUE_HOLDS_STRING(value) && g_value_get_string(value)) {
    g_value_set_string(value, lf::redacted_location(g_value_get_string(value)).c_str());
  } else if (G_VALUE_HOLDS(value, G_TYPE_ERROR) && g_value_get_boxed(value)) {
    const auto* error = static_cast<const GError*>(g_value_get_boxed(value));
    const std::string text = lf::redacted_location(error->message);
    g_value_take_boxed(value, g_error_new_literal(error->domain, error->code, text.c_str()));
  } else if (GST_VALUE_HOLDS_STRUCTURE(value) && gst_value_get_structure(value)) {
    GstStructure* copy = gst_structure_copy(gst_value_get_structure(value));
    gst_structure_map_in_place(copy, hide_secret, nullptr);
    g_value_take_boxed(value, copy);
  }
  return TRUE;
}

// Removes passwords from all texts of a message, because errors, warnings, progress and structures may contain the URI
// of the camera. Applies redacted_location() to the texts and removes all fields of "http-headers". Takes `message` and
// returns it or a copy.
static GstMessage* hide_secrets(GstMessage* message) {
  if (!gst_message_get_structure(message)) return message;
  message = gst_message_make_writable(message);
  GstStructure* structure = gst_message_writable_structure(message);
  if (gst_structure_has_name(structure, "http-headers"))
    gst_structure_remove_all_fields(structure);  // souphttpsrc: contains the Base64 password and cookies
  else
    gst_structure_map_in_place(structure, hide_secret, nullptr);
  return message;
}

// Most messages of other elements end with a period, which would look wrong in front of further text.
static std::string without_period(std::string text) {
  while (!text.empty() && strchr(". \n", text.back())) text.pop_back();
  return text;
}

// Returns "401" or "403" if an error of souphttpsrc means that the server has refused the user name or password, and
// otherwise "". The status is needed because the text of the error contains words that the server has chosen.
static std::string refusing_status(const GError* error, const gchar* debug) {
  if (!debug || !g_error_matches(error, GST_RESOURCE_ERROR, GST_RESOURCE_ERROR_NOT_AUTHORIZED)) return "";
  return strstr(debug, "(401), URL") ? "401" : strstr(debug, "(403), URL") ? "403" : "";
}

// Returns the text for an error of a child element: the name of the camera, the error, and a better reason if the
// negotiation of the format failed.
static std::string describe(const std::string& place, const std::string& wanted, const GError* error,
                            const gchar* debug) {
  if (const std::string status = refusing_status(error, debug); !status.empty())
    return place + ": the camera refuses access (HTTP " + status + ", " + without_period(error->message) + ")";
  if (wanted.empty() || !debug || !strstr(debug, "not-negotiated"))
    return place + ": " + without_period(error->message);
  const bool v4l2 = place.find("v4l2") != std::string::npos;
  return place + ": it gives no pictures of " + wanted +
         (v4l2 ? "; v4l2-ctl --list-formats-ext lists the formats of a V4L2 device" : "");
}

// Filters the messages of the children, and adds the name of the camera to errors. If the camera may be lost, other
// warnings of children are only logged, because they precede an error or are harmless.
static void lf_cam_src_handle_message(GstBin* bin, GstMessage* message) {
  LfCamSrc* self = LF_CAM_SRC(bin);
  message = hide_secrets(message);
  if (lf::take_decoder_message(bin, message)) return;
  // Drops buffering messages, because buffering of an HTTP file must not pause the whole array.
  if (GST_MESSAGE_TYPE(message) == GST_MESSAGE_BUFFERING) return gst_message_unref(message);
  lf::ObjectLock lock(self);
  const std::shared_ptr<lf::CameraStream> stream = self->run ? self->run->stream : nullptr;
  const std::string wanted = self->run ? self->run->wanted : "";
  const bool loops = self->run && self->run->settings.loop;
  lock.unlock();
  const GstMessageType type = GST_MESSAGE_TYPE(message);
  if (loops && (type == GST_MESSAGE_SEGMENT_START || type == GST_MESSAGE_SEGMENT_DONE)) {
    gst_message_unref(message);
    return;
  }
  const guint serial = static_cast<guint>(g_atomic_int_get(&self->serial));
  const bool is_error = GST_MESSAGE_TYPE(message) == GST_MESSAGE_ERROR;
  const bool is_warning = GST_MESSAGE_TYPE(message) == GST_MESSAGE_WARNING;
  if (is_warning && stream && lf::is_picture_source(GST_MESSAGE_SRC(message))) {
    g_autoptr(GError) warning = nullptr;
    g_autofree gchar* debug = nullptr;
    gst_message_parse_warning(message, &warning, &debug);
    lf_cam_src_post(self, GST_MESSAGE_WARNING,
                    {warning->domain, warning->code, stream->place() + ": " + without_period(warning->message), debug});
    return gst_message_unref(message);
  }
  if (!(is_error && stream) && !(lf_cam_src_may_be_lost(self) && (is_error || is_warning))) {
    GST_BIN_CLASS(lf_cam_src_parent_class)->handle_message(bin, message);
    return;
  }
  if (is_error && stream && stream->first_error()) {
    g_autoptr(GError) error = nullptr;
    g_autofree gchar* debug = nullptr;
    gst_message_parse_error(message, &error, &debug);
    lf_cam_src_fail(self,
                    {error->domain, error->code, describe(stream->place(), wanted, error, debug), debug ? debug : ""});
    lf_cam_src_shut_down(self, serial);
  } else {
    GST_INFO_OBJECT(self, "%" GST_PTR_FORMAT, message);
  }
  gst_message_unref(message);
}

static void lf_cam_src_deep_element_added(GstBin* bin, GstBin* parent, GstElement* child) {
  LfCamSrc* self = LF_CAM_SRC(bin);
  const std::shared_ptr<lf::CameraStream> stream = stream_of(self);
  GstElementFactory* factory = gst_element_get_factory(child);
  if (stream && factory && g_str_equal(GST_OBJECT_NAME(factory), "multipartdemux")) {
    self->live = true;
    stream->stamp_arrivals(child);
  }
  if (stream) stream->watch_element(child);  // before the shedder drops buffers
  (*self->shedder)->watch(child);
  GST_BIN_CLASS(lf_cam_src_parent_class)->deep_element_added(bin, parent, child);
}

// Handles EOS from the application (gst-launch-1.0 -e). Some children ignore EOS while a file loops, so the next frame
// ends the stream. No camera is being opened, because the caller, gst_element_send_event(), holds the state lock.
static gboolean lf_cam_src_send_event(GstElement* element, GstEvent* event) {
  LfCamSrc* self = LF_CAM_SRC(element);
  if (GST_EVENT_TYPE(event) != GST_EVENT_EOS)
    return GST_ELEMENT_CLASS(lf_cam_src_parent_class)->send_event(element, event);
  gst_event_unref(event);
  bool running = self->run != nullptr;
  if (running) {
    self->run->stream->end();
  } else if (self->service->state() == State::kLost) {
    lf_cam_src_end_lost(self);
    running = true;
  }
  return running;
}

static Settings& settings_of(LfCamSrc* self) { return *self->settings; }
static GstStructure* stats_of(LfCamSrc* self) {
  GstStructure* stats = lf_cam_src_stats(self, "lightfield-camera-stats");
  lf_cam_src_add_controls(self, stats);
  return stats;
}

static void lf_cam_src_finalize(GObject* object) {
  LfCamSrc* self = LF_CAM_SRC(object);
  lf_cam_src_cancel_timers(self);
  delete self->run;
  delete self->settings;
  delete self->service;
  delete self->shedder;
  delete self->tap;
  delete self->name;
  G_OBJECT_CLASS(lf_cam_src_parent_class)->finalize(object);
}

static void lf_cam_src_class_init(LfCamSrcClass* klass) {
  GObjectClass* object_class = G_OBJECT_CLASS(klass);
  object_class->finalize = lf_cam_src_finalize;

  lf::Properties<settings_of, stats_of>::install(
      object_class,
      "State of the camera. The field state is stopped, opening, running, ended or lost. reason describes the latest "
      "loss, losses counts the losses, and retries counts the attempts to reopen the camera. dropped counts frames "
      "that were skipped because this machine is too slow. damaged counts pictures that can't be decoded. capture-time "
      "names the origin of the capture times: source (timestamps of the source), sender-reports (RTCP reports of an "
      "RTSP camera), or arrival (the arrival of the packets, used until the first report). controls contains the known "
      "controls, such as exposure time, and the controls in the rig. Each value is a number, auto, or FALSE if the "
      "camera lacks the control. control-values contains the current numbers of these controls");

  GstElementClass* element_class = GST_ELEMENT_CLASS(klass);
  element_class->change_state = lf::callback<lf_cam_src_change_state>;
  element_class->send_event = lf::callback<lf_cam_src_send_event>;
  GST_BIN_CLASS(klass)->handle_message = lf::callback<lf_cam_src_handle_message>;
  GST_BIN_CLASS(klass)->element_added = lf::callback<lf::lock_decoder>;
  GST_BIN_CLASS(klass)->deep_element_added = lf::callback<lf_cam_src_deep_element_added>;
  gst_element_class_add_static_pad_template(element_class, &src_template);
  gst_element_class_set_static_metadata(
      element_class, "Light field camera source", "Source/Video",
      "Outputs the video of one camera of a rig, from a device, file, still, image sequence or the built-in scene",
      "gst-lightfield");
}

static void lf_cam_src_init(LfCamSrc* self) {
  self->settings = new Settings;
  self->service = new lf::CameraLifecycle;
  self->shedder = new std::shared_ptr<lf::LoadShedder>(std::make_shared<lf::LoadShedder>());
  self->tap = new lf::RecordingTap;
  self->name = new std::string;
  // The element is a source even while it has no children. It never provides the clock.
  gst_bin_set_suppressed_flags(
      GST_BIN(self),
      static_cast<GstElementFlags>(GST_ELEMENT_FLAG_SOURCE | GST_ELEMENT_FLAG_SINK | GST_ELEMENT_FLAG_PROVIDE_CLOCK));
  GST_OBJECT_FLAG_SET(self, GST_ELEMENT_FLAG_SOURCE);
  g_autoptr(GstPadTemplate) pad_template = gst_static_pad_template_get(&src_template);
  self->src = gst_ghost_pad_new_no_target_from_template("src", pad_template);
  gst_pad_set_query_function(self->src, lf::callback<on_query>);
  gst_element_add_pad(GST_ELEMENT(self), self->src);
}
