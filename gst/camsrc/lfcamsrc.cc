// SPDX-License-Identifier: LGPL-2.1-or-later

/**
 * SECTION:element-lfcamsrc
 * @title: lfcamsrc
 * @short_description: one camera of a rig as a source of video
 *
 * Gives the camera's `source` (a video file, an image sequence `dir/frame_%04d.jpg` counted from 0 or 1, a file of JPEG
 * pictures one behind another, any other GStreamer URI, or elements as gst-launch-1.0 reads them, `libcamerasrc
 * camera-name=a ! video/x-raw,width=640`), else its `image` (a still), else the built-in scene, seen with the camera's
 * pose and lens. Formats stay as decoded
 * wherever they are of the RGB family or I420. Frames have the size that the rig gives the camera; anything else is an
 * error. With `decode=false` JPEG video comes as it is, and pictures in a graphics card's memory do where these are
 * taken.
 *
 * Elements are asked for the size in the rig, and for `framerate` if it is given. Sources, converters and decoders of a
 * short list need no more than a rig file that nobody else can write. Any other element, which may write files or run
 * programs, needs `trusted=true`; so does a view of another light field (`lf:///path/of/rig.json`).
 *
 * Messages and `stats` name sources without the users and passwords in them.
 *
 * Devices and elements are set to the camera's `controls`.
 *
 * The stream carries the sticky event `lightfield-camera` (which camera of which rig) and each frame a
 * #GstReferenceTimestampMeta of `timestamp/x-lightfield-capture` with its true capture time: clock time where frames
 * are live, running time where not, plus the camera's time offset.
 *
 * A camera behind RTSP says in its sender reports when frames were taken, by its clock, which has to be that of this
 * machine (NTP): these times are believed unless they can't be true. Without them, as in the first seconds, a frame was
 * taken when it came. `stats` say which.
 *
 * Motion JPEG over HTTP (`http://HOST/stream`, multipart/x-mixed-replace) is live; a frame was taken when it came.
 *
 * Films are turned as they ask for (the matrix of an MP4). EXIF orientations of pictures are not followed, as COLMAP
 * does not: a warning tells. A damaged still is an error. A damaged picture of an image sequence, or one of Motion JPEG
 * that was cut off, has no frame and is counted (`damaged` in `stats`). A gap in a sequence is an error.
 *
 * With `retry` a camera that fails (or is not there, or ends though it should not) is no error: it is opened again,
 * with a quarter of the time it has been out between attempts, half a second at least and ten at most. Downstream there
 * are no frames meanwhile. A live file then goes on where it would be.
 *
 * ## Example launch line
 * |[
 * gst-launch-1.0 lfcamsrc rig=rig.json camera=5 ! videoconvert ! autovideosink
 * ]|
 *
 * ## Element messages
 * With `retry` "lightfield-camera-lost": camera (uint: its id), name, reason (strings), beside one warning; and
 * "lightfield-camera-found": camera, name, with the first frame after that.
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
#include "rig/source_security.h"

GST_DEBUG_CATEGORY(lf_cam_src_debug);
#define GST_CAT_DEFAULT lf_cam_src_debug

using Settings = lf::CamSrcSettings;
using State = lf::CameraService::State;

G_DEFINE_TYPE_WITH_CODE(LfCamSrc, lf_cam_src, GST_TYPE_BIN,
                        GST_DEBUG_CATEGORY_INIT(lf_cam_src_debug, "lfcamsrc", 0, "one camera of a rig as a source"))
GST_ELEMENT_REGISTER_DEFINE(lfcamsrc, "lfcamsrc", GST_RANK_NONE, LF_TYPE_CAM_SRC)

lf::PropertyTable<Settings>& Settings::properties() {
  using namespace lf;
  using S = Settings;
  static PropertyTable<S> table = {
      property<&S::rig>(kWhileReady, "rig", "Rig", "Path of the rig file (rig.json) that describes the camera"),
      property<&S::camera>(kWhileReady, "camera", "Camera", "Id of the camera in the rig file", 0u, G_MAXUINT),
      fraction_property<&S::fps_n, &S::fps_d>(
          kWhileReady, "framerate", "Frame rate",
          "Frames per second (0/1 = as the source has them; 15/1 for stills, image sequences and the built-in scene, "
          "which have no rate of their own). Videos of another rate get frames dropped or repeated",
          0, 1),
      property<&S::is_live>(kWhileReady, "is-live", "Is live",
                            "Frames come at their time on the pipeline's clock, as from a device, in place of as fast "
                            "as they are taken"),
      property<&S::loop>(kWhileReady, "loop", "Loop",
                         "Videos and image sequences begin again at their end, with running time going on"),
      property<&S::num_frames>(kWhileReady, "num-frames", "Number of frames",
                               "Frames after which the stream ends (-1 = when the source does: stills and the built-in "
                               "scene never do)",
                               gint64{-1}, G_MAXINT64),
      property<&S::decode>(
          kWhileReady, "decode", "Decode",
          "Raw video in the computer's memory, whatever the source is; without it JPEG video, and what "
          "is in a graphics card's memory, comes as it is, for lffragment to read where it needs it"),
      property<&S::latency>(kWhileReady, "latency", "Latency",
                            "Network cameras (RTSP): how long packets are waited for and put in order, in nanoseconds",
                            guint64{0}, guint64{60 * GST_SECOND}),
      property<&S::retry>(kWhileReady, "retry", "Retry",
                          "A camera that fails is opened again, after half a second at first and after ten seconds at "
                          "most, in place of an error: the element messages lightfield-camera-lost and "
                          "lightfield-camera-found and a warning tell"),
      property<&S::trusted>(kWhileReady, "trusted", "Trusted",
                            "Whether the rig file may run any element: without it, sources that describe elements can "
                            "have sources, converters and decoders of a short list only"),
  };
  return table;
}

static GstStaticPadTemplate src_template = GST_STATIC_PAD_TEMPLATE(
    "src", GST_PAD_SRC, GST_PAD_ALWAYS,
    GST_STATIC_CAPS(GST_VIDEO_CAPS_MAKE("{ " LF_RGB_FORMATS
                                        ", I420 }") "; image/jpeg; " LF_CARD_VIDEO_CAPS("{ " LF_CAMERA_FORMATS " }")));

// Nanoseconds between frames, by the rate in the source pad's caps.
static GstClockTime lf_cam_src_period(LfCamSrc* self) {
  GstCaps* caps = gst_pad_get_current_caps(self->src);
  int fps_n = 0, fps_d = 1;
  if (caps) {
    gst_structure_get_fraction(gst_caps_get_structure(caps, 0), "framerate", &fps_n, &fps_d);
    gst_caps_unref(caps);
  }
  if (fps_n <= 0 || fps_d <= 0) return GST_SECOND / lf::kDefaultFps;
  return gst_util_uint64_scale(GST_SECOND, static_cast<guint64>(fps_d), static_cast<guint64>(fps_n));
}

bool lf_cam_src_is_live(LfCamSrc* self) { return self->live; }

void lf_cam_src_set_keeper(LfCamSrc* self, const lf::CameraKeeper& keeper) { *self->keeper = keeper; }

// --- Loss and retry --------------------------------------------------------------------------------------------------
//
// A camera that fails where that is no error: it is closed, and opened again after a while, on threads of their own, as
// neither may be done by the threads that streamed. Each of these steps has the element's state to itself; those that
// were planned before the element was stopped, or opened anew, are void.

static GstStructure* lf_cam_src_structure(LfCamSrc* self, const char* name) {
  GST_OBJECT_LOCK(self);
  GstStructure* structure =
      gst_structure_new(name, "camera", G_TYPE_UINT, self->camera, "name", G_TYPE_STRING, self->name->c_str(), nullptr);
  GST_OBJECT_UNLOCK(self);
  return structure;
}

static void lf_cam_src_post_structure(LfCamSrc* self, GstStructure* structure) {
  gst_element_post_message(GST_ELEMENT(self), gst_message_new_element(GST_OBJECT(self), structure));
}

static bool lf_cam_src_retries(LfCamSrc* self) {
  GST_OBJECT_LOCK(self);
  const bool retry = self->settings->retry;
  GST_OBJECT_UNLOCK(self);
  return retry && (self->live || !g_atomic_int_get(&self->expendable));
}

void lf_cam_src_set_expendable(LfCamSrc* self) { g_atomic_int_set(&self->expendable, TRUE); }

// Puts into `stats` what the camera's controls are, which asks its device: not for every frame.
static void lf_cam_src_add_controls(LfCamSrc* self, GstStructure* stats) {
  lf::ObjectLock lock(self);
  GstElement* device = self->run ? self->run->chain.device : nullptr;
  if (device) gst_object_ref(device);
  const lf::Controls wanted = self->run ? self->run->controls : lf::Controls{};
  lock.unlock();
  GstStructure* controls = device ? lf::read_controls(device, wanted) : gst_structure_new_empty("lightfield-controls");
  GstStructure* values =
      device ? lf::read_control_values(device, wanted) : gst_structure_new_empty("lightfield-controls");
  if (!device)
    for (const auto& [name, value] : wanted) gst_structure_set(controls, name.c_str(), G_TYPE_BOOLEAN, FALSE, nullptr);
  gst_structure_set(stats, "controls", GST_TYPE_STRUCTURE, controls, "control-values", GST_TYPE_STRUCTURE, values,
                    nullptr);
  gst_structure_free(controls);
  gst_structure_free(values);
  if (device) gst_object_unref(device);
}

GstStructure* lf_cam_src_stats(LfCamSrc* self, const char* name) {
  const lf::CameraService::Report report = self->service->report();
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

const lf::CameraService& lf_cam_src_service(LfCamSrc* self) { return *self->service; }

bool lf_cam_src_is_lost_for_good(LfCamSrc* self) {
  return self->service->state() == State::kLost && !lf_cam_src_retries(self);
}

bool lf_cam_src_may_be_lost(LfCamSrc* self) {
  GST_OBJECT_LOCK(self);
  const bool retry = self->settings->retry;
  GST_OBJECT_UNLOCK(self);
  return retry || g_atomic_int_get(&self->expendable);
}

static void lf_cam_src_post(LfCamSrc* self, GstMessageType type, const CamSrcFailure& failure, const char* more = "") {
  const std::string text = lf::location_text(failure.text) + more, debug = lf::location_text(failure.debug);
  gst_element_message_full(GST_ELEMENT(self), type, failure.domain, failure.code, g_strdup(text.c_str()),
                           debug.empty() ? nullptr : g_strdup(debug.c_str()), __FILE__, GST_FUNCTION, __LINE__);
}

void lf_cam_src_fail(LfCamSrc* self, const CamSrcFailure& failure) {
  if (!lf_cam_src_may_be_lost(self)) return lf_cam_src_post(self, GST_MESSAGE_ERROR, failure);
  const std::string reason = lf::location_text(failure.text);
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

void lf_cam_src_tell_found(LfCamSrc* self) {
  GST_INFO_OBJECT(self, "back again");
  lf_cam_src_post_structure(self, lf_cam_src_structure(self, LF_CAMERA_FOUND));
}

// Of all cameras of the process one for a while.
void lf_cam_src_tell_overload(LfCamSrc* self, GstClockTimeDiff late) {
  constexpr uint64_t kQuiet = 10'000'000'000;
  static std::atomic<uint64_t> told = 0;
  const uint64_t now = lf::now_ns(), before = told.exchange(now);
  if (before != 0 && now - before < kQuiet) return;
  lf::ObjectLock lock(self);
  const std::string place = self->run ? self->run->stream->place() : "";
  lock.unlock();
  GST_ELEMENT_WARNING(
      self, STREAM, DECODE,
      ("%s: this machine can't decode all frames, they come %d ms late: some are dropped before they are "
       "decoded, up to the next key frame that can be on time",
       place.c_str(), static_cast<int>(late / GST_MSECOND)),
      ("further ones, of other cameras, too, are counted in stats"));
}

void lf_cam_src_tell_cut_off(LfCamSrc* self, GstClockTime lasted, GstClockTime missing) {
  const auto seconds = [](GstClockTime time) {
    return lf::format_text("%.2f", static_cast<double>(time) / GST_SECOND);
  };
  lf::ObjectLock lock(self);
  const std::string place = self->run ? self->run->stream->place() : "";
  lock.unlock();
  GST_ELEMENT_WARNING(
      self, STREAM, DECODE,
      ("%s: is cut off: it ends after %s of %s s. %s, each time it loops", place.c_str(), seconds(lasted).c_str(),
       seconds(lasted + missing).c_str(),
       self->live ? "It gives nothing for the rest" : "For the rest its picture that is nearest in time stands"),
      (nullptr));
}

// Tells downstream that no frame comes, by the event LF_CAMERA_LOST.
static void lf_cam_src_push_lost(LfCamSrc* self) {
  gst_pad_push_event(self->src,
                     gst_event_new_custom(GST_EVENT_CUSTOM_DOWNSTREAM, gst_structure_new_empty(LF_CAMERA_LOST)));
}

// Whether nothing has been opened or stopped since `serial`.
static bool lf_cam_src_is_due(LfCamSrc* self, guint serial) {
  return static_cast<guint>(g_atomic_int_get(&self->serial)) == serial && GST_STATE(self) >= GST_STATE_PAUSED &&
         GST_STATE_TARGET(self) >= GST_STATE_PAUSED;
}

// Calls `step` with the state lock, on a thread of its own, if it is still due then.
static void lf_cam_src_call_step(LfCamSrc* self, guint serial, void (*step)(LfCamSrc*)) {
  struct Call {
    guint serial;
    void (*step)(LfCamSrc*);
  };
  gst_element_call_async(
      GST_ELEMENT(self),
      [](GstElement* element, gpointer data) {
        const auto* call = static_cast<Call*>(data);
        GST_STATE_LOCK(element);
        lf::guarded(element, 0, [=] {
          if (lf_cam_src_is_due(LF_CAM_SRC(element), call->serial)) call->step(LF_CAM_SRC(element));
          return 0;
        });
        GST_STATE_UNLOCK(element);
      },
      new Call{serial, step}, [](gpointer data) { delete static_cast<Call*>(data); });
}

// The same after `delay`, in place of what is planned.
static void lf_cam_src_call_later(LfCamSrc* self, GstClockTime delay, void (*step)(LfCamSrc*)) {
  struct Plan {
    GWeakRef element;
    guint serial;
    void (*step)(LfCamSrc*);
  };
  auto* plan = new Plan{{}, static_cast<guint>(g_atomic_int_get(&self->serial)), step};
  g_weak_ref_init(&plan->element, self);
  GstClock* clock = gst_system_clock_obtain();
  GstClockID timer = gst_clock_new_single_shot_id(clock, gst_clock_get_time(clock) + delay);
  gst_clock_id_wait_async(
      timer,
      [](GstClock*, GstClockTime, GstClockID, gpointer data) -> gboolean {
        auto* due = static_cast<Plan*>(data);
        if (gpointer element = g_weak_ref_get(&due->element)) {
          lf::guarded(element, 0, [=] { return lf_cam_src_call_step(LF_CAM_SRC(element), due->serial, due->step), 0; });
          gst_object_unref(element);
        }
        return TRUE;
      },
      plan,
      [](gpointer data) {
        g_weak_ref_clear(&static_cast<Plan*>(data)->element);
        delete static_cast<Plan*>(data);
      });
  gst_object_unref(clock);
  GST_OBJECT_LOCK(self);
  GstClockID before = std::exchange(self->timer, timer);
  GST_OBJECT_UNLOCK(self);
  if (!before) return;
  gst_clock_id_unschedule(before);
  gst_clock_id_unref(before);
}

// Plans the next attempt, if there is one to be.
static void lf_cam_src_schedule_retry(LfCamSrc* self);

static void lf_cam_src_close_lost(LfCamSrc* self) {
  lf_cam_src_close(self);
  lf_cam_src_push_lost(self);  // again: a frame may have been on its way
  lf_cam_src_schedule_retry(self);
}

// Downstream is told without the state lock, as a file's frames may be waiting there for requests; but after a change
// of state that is under way.
void lf_cam_src_take_out(LfCamSrc* self, guint serial) {
  if (!lf_cam_src_may_be_lost(self)) return;
  gst_element_call_async(
      GST_ELEMENT(self),
      [](GstElement* element, gpointer data) {
        LfCamSrc* cam_src = LF_CAM_SRC(element);
        GST_STATE_LOCK(element);
        const bool is_due = lf_cam_src_is_due(cam_src, GPOINTER_TO_UINT(data));
        GST_STATE_UNLOCK(element);
        if (!is_due) return;
        lf_cam_src_push_lost(cam_src);
        // Without another attempt the children stay as they are: frames on their way still arrive.
        lf::guarded(element, 0, [=] {
          if (lf_cam_src_retries(cam_src)) lf_cam_src_call_step(cam_src, GPOINTER_TO_UINT(data), lf_cam_src_close_lost);
          return 0;
        });
      },
      GUINT_TO_POINTER(serial), nullptr);
}

// Cables can be pulled so that nobody says a word.
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
  if (!self->run->stream->first_error()) return;  // that has been told
  lf_cam_src_fail(
      self,
      {GST_RESOURCE_ERROR, GST_RESOURCE_ERROR_READ,
       self->run->stream->place() + ": no frame for " + std::to_string((now - self->active) / GST_SECOND) + " s", ""});
  lf_cam_src_take_out(self, static_cast<guint>(g_atomic_int_get(&self->serial)));
}

// Has a live camera of a node watched for frames that fail to come.
static void lf_cam_src_watch(LfCamSrc* self) {
  // Alone, its downstream may stop it for as long as it likes.
  if (!self->live || !self->run || !g_atomic_int_get(&self->expendable)) return;
  self->active = lf::now_ns();
  lf_cam_src_call_later(self, GST_SECOND, lf_cam_src_look_for_frames);
}

// Where the children have refused to start: as lf_cam_src_fail(), and they are removed.
static void lf_cam_src_fail_to_start(LfCamSrc* self) {
  if (self->run->stream->first_error())
    lf_cam_src_fail(
        self, {GST_CORE_ERROR, GST_CORE_ERROR_STATE_CHANGE, self->run->stream->place() + ": can't be started", ""});
  g_atomic_int_inc(&self->serial);  // its errors have been told
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
  GstStateChangeReturn result = lf::pause_new_children(bin);
  if (result == GST_STATE_CHANGE_NO_PREROLL) {
    self->live = true;
    self->run->stream->set_live();
  }
  if (result != GST_STATE_CHANGE_FAILURE && GST_STATE_TARGET(self) == GST_STATE_PLAYING)
    result = lf::play_new_children(bin);
  if (result == GST_STATE_CHANGE_FAILURE) return lf_cam_src_fail_to_start(self);
  lf_cam_src_watch(self);
}

static void lf_cam_src_schedule_retry(LfCamSrc* self) {
  if (lf_cam_src_retries(self)) lf_cam_src_call_later(self, self->service->wait(lf::now_ns()), lf_cam_src_try_again);
}

// Cancels the attempts and looks that are planned.
static void lf_cam_src_cancel_plans(LfCamSrc* self) {
  g_atomic_int_inc(&self->serial);
  GST_OBJECT_LOCK(self);
  GstClockID before = std::exchange(self->timer, nullptr);
  GST_OBJECT_UNLOCK(self);
  if (!before) return;
  gst_clock_id_unschedule(before);
  gst_clock_id_unref(before);
}

// A lost camera is not waited for any more: its stream ends. With the state lock, which is why the event is not sent by
// this thread, which may be anyone's; and in no later run than this one.
static void lf_cam_src_end_lost(LfCamSrc* self) {
  lf_cam_src_cancel_plans(self);
  lf_cam_src_call_step(self, static_cast<guint>(g_atomic_int_get(&self->serial)),
                       [](LfCamSrc* camera) { gst_pad_push_event(camera->src, gst_event_new_eos()); });
}

// A live stream may come up to one frame time after its stamps: a frame takes as long to be had.
static gboolean on_query(GstPad* pad, GstObject* parent, GstQuery* query) {
  if (!gst_pad_query_default(pad, parent, query)) return FALSE;
  if (GST_QUERY_TYPE(query) != GST_QUERY_LATENCY) return TRUE;
  gboolean live = FALSE;
  GstClockTime min = 0, max = GST_CLOCK_TIME_NONE;
  gst_query_parse_latency(query, &live, &min, &max);
  if (!live) return TRUE;
  min = std::max(min, lf_cam_src_period(LF_CAM_SRC(parent)));
  gst_query_set_latency(query, live, min, std::max(min, max));  // GST_CLOCK_TIME_NONE, the largest, is no bound
  return TRUE;
}

// --- States ----------------------------------------------------------------------------------------------------------

// Children for the current settings. False, without children, after posting why not; where that is no error there are
// none either.
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
  GST_OBJECT_LOCK(self);
  const bool stale = !self->run || self->run->used || self->run->settings != *self->settings;
  GST_OBJECT_UNLOCK(self);
  return stale;
}

// Before the children change state; false after posting an error.
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
    lf_cam_src_cancel_plans(self);
    if (!self->run) return true;
    lf_cam_src_stop_flow(self);
  }
  return true;
}

// A camera without children, as there is nothing to open, is in whatever state it is asked for.
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

// In PAUSED: what could not be done before.
static void lf_cam_src_begin(LfCamSrc* self) {
  if (!self->run) {
    lf_cam_src_push_lost(self);
    lf_cam_src_schedule_retry(self);
  } else if (self->run->stream->has_failed()) {
    lf_cam_src_take_out(self, static_cast<guint>(g_atomic_int_get(&self->serial)));
  } else {
    lf_cam_src_watch(self);
  }
}

// Whether a source that is no device fails before its first frame. Waits for either, for a limited time: an error that
// is posted while the state changes must fail that change, and gst-launch-1.0 overlooks one that comes just behind it.
static bool fails_at_start(LfCamSrc* self) {
  constexpr uint64_t kPatience = 2'000'000'000;
  const lf::CameraStream& stream = *self->run->stream;
  for (const uint64_t end = lf::now_ns() + kPatience; lf::now_ns() < end && stream.is_opening();) g_usleep(1000);
  return stream.has_failed();
}

static GstStateChangeReturn lf_cam_src_change_state(GstElement* element, GstStateChange transition) {
  LfCamSrc* self = LF_CAM_SRC(element);
  if (!prepare(self, transition)) return GST_STATE_CHANGE_FAILURE;
  GstStateChangeReturn result = change_children(self, transition);
  if (transition == GST_STATE_CHANGE_READY_TO_PAUSED) {
    // A live child gives no frame before PLAYING, so that this comes in time.
    if (result == GST_STATE_CHANGE_NO_PREROLL) {
      self->live = true;
      if (self->run) self->run->stream->set_live();
    }
    if (result != GST_STATE_CHANGE_FAILURE) lf_cam_src_begin(self);
    const bool may_wait = result == GST_STATE_CHANGE_SUCCESS && self->run && !lf_cam_src_may_be_lost(self);
    // The children are stopped on the way to NULL, behind the sinks, which may hold their threads.
    if (may_wait && fails_at_start(self)) result = GST_STATE_CHANGE_FAILURE;
  }
  if (transition == GST_STATE_CHANGE_PAUSED_TO_READY) self->service->stop();
  if (transition == GST_STATE_CHANGE_READY_TO_NULL ||
      (transition == GST_STATE_CHANGE_NULL_TO_READY && result == GST_STATE_CHANGE_FAILURE))
    lf_cam_src_close(self);
  return result;
}

// --- Messages --------------------------------------------------------------------------------------------------------

static bool has_secret(const gchar* text) { return text && lf::location_text(text) != text; }

static gboolean find_secret(GQuark /*field*/, const GValue* value, gpointer data) {
  bool& found = *static_cast<bool*>(data);
  if (G_VALUE_HOLDS_STRING(value))
    found = found || has_secret(g_value_get_string(value));
  else if (G_VALUE_HOLDS(value, G_TYPE_ERROR) && g_value_get_boxed(value))
    found = found || has_secret(static_cast<const GError*>(g_value_get_boxed(value))->message);
  else if (GST_VALUE_HOLDS_STRUCTURE(value) && gst_value_get_structure(value))
    gst_structure_foreach(gst_value_get_structure(value), find_secret, data);
  return !found;
}

static gboolean hide_secret(GQuark /*field*/, GValue* value, gpointer /*unused*/) {
  if (G_VALUE_HOLDS_STRING(value) && g_value_get_string(value)) {
    g_value_set_string(value, lf::location_text(g_value_get_string(value)).c_str());
  } else if (G_VALUE_HOLDS(value, G_TYPE_ERROR) && g_value_get_boxed(value)) {
    const auto* error = static_cast<const GError*>(g_value_get_boxed(value));
    const std::string text = lf::location_text(error->message);
    g_value_take_boxed(value, g_error_new_literal(error->domain, error->code, text.c_str()));
  } else if (GST_VALUE_HOLDS_STRUCTURE(value) && gst_value_get_structure(value)) {
    GstStructure* copy = gst_structure_copy(gst_value_get_structure(value));
    gst_structure_map_in_place(copy, hide_secret, nullptr);
    g_value_take_boxed(value, copy);
  }
  return TRUE;
}

// The message with location_text() of all its texts: errors, warnings, progress and structures of the elements that
// open a camera may name its URI. "http-headers" loses all fields. Takes `message` and returns it, or a copy.
static GstMessage* hide_secrets(GstMessage* message) {
  const GstStructure* structure = gst_message_get_structure(message);
  // souphttpsrc: the password in Base64, and cookies.
  if (structure && gst_structure_has_name(structure, "http-headers")) {
    message = gst_message_make_writable(message);
    gst_structure_remove_all_fields(gst_message_writable_structure(message));
    return message;
  }
  bool found = false;
  if (structure) gst_structure_foreach(structure, find_secret, &found);
  if (!found) return message;
  message = gst_message_make_writable(message);
  gst_structure_map_in_place(gst_message_writable_structure(message), hide_secret, nullptr);
  return message;
}

// Of what other elements say, to be gone on after: most of them end with a period.
static std::string without_period(std::string text) {
  while (!text.empty() && strchr(". \n", text.back())) text.pop_back();
  return text;
}

// What an error of a child is about, beside the text it has: the camera and what is known better here.
static std::string describe(const std::string& place, const std::string& wanted, const GError* error,
                            const gchar* debug) {
  if (wanted.empty() || !debug || !strstr(debug, "not-negotiated"))
    return place + ": " + without_period(error->message);
  const bool v4l2 = place.find("v4l2") != std::string::npos;
  return place + ": it gives no pictures of " + wanted +
         (v4l2 ? "; v4l2-ctl --list-formats-ext lists what a V4L2 device has" : "");
}

// Errors of the children know nothing of cameras: says whose they are. Of a camera that may be lost that is all that is
// told: their warnings come before an error or mean nothing.
static void lf_cam_src_handle_message(GstBin* bin, GstMessage* message) {
  LfCamSrc* self = LF_CAM_SRC(bin);
  message = hide_secrets(message);
  if (lf::take_decoder_message(bin, message)) return;
  // Of films over HTTP. To an array, which may have many, it is no reason to pause.
  if (GST_MESSAGE_TYPE(message) == GST_MESSAGE_BUFFERING) return gst_message_unref(message);
  lf::ObjectLock lock(self);
  const std::shared_ptr<lf::CameraStream> stream = self->run ? self->run->stream : nullptr;
  const std::string wanted = self->run ? self->run->wanted : "";
  const bool loops = self->run && self->run->settings.loop;
  lock.unlock();
  const GstMessageType type = GST_MESSAGE_TYPE(message);
  if (loops && (type == GST_MESSAGE_SEGMENT_START || type == GST_MESSAGE_SEGMENT_DONE)) {
    gst_message_unref(message);  // of rounds nobody hears
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
    lf_cam_src_take_out(self, serial);
  } else {
    GST_INFO_OBJECT(self, "%" GST_PTR_FORMAT, message);
  }
  gst_message_unref(message);
}

static void lf_cam_src_deep_element_added(GstBin* bin, GstBin* parent, GstElement* child) {
  LfCamSrc* self = LF_CAM_SRC(bin);
  lf::ObjectLock lock(self);
  const std::shared_ptr<lf::CameraStream> stream = self->run ? self->run->stream : nullptr;
  lock.unlock();
  GstElementFactory* factory = gst_element_get_factory(child);
  if (stream && factory && g_str_equal(GST_OBJECT_NAME(factory), "multipartdemux")) {
    self->live = true;
    stream->stamp_arrivals(child);
  }
  if (stream) stream->watch_element(child);  // before what the shedder leaves out
  (*self->shedder)->watch(child);
  GST_BIN_CLASS(lf_cam_src_parent_class)->deep_element_added(bin, parent, child);  // tells the bins around this one
}

// "EOS, please" from the application (gst-launch-1.0 -e). Not all children take it while files loop; the next frame
// ends the stream in its place. gst_element_send_event() holds the state lock: no camera is being opened.
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

// --- GObject ---------------------------------------------------------------------------------------------------------

static Settings& settings_of(LfCamSrc* self) { return *self->settings; }
static GstStructure* stats_of(LfCamSrc* self) {
  GstStructure* stats = lf_cam_src_stats(self, "lightfield-camera-stats");
  lf_cam_src_add_controls(self, stats);
  return stats;
}

static void lf_cam_src_finalize(GObject* object) {
  LfCamSrc* self = LF_CAM_SRC(object);
  lf_cam_src_cancel_plans(self);
  delete self->run;
  delete self->settings;
  delete self->service;
  delete self->shedder;
  delete self->keeper;
  delete self->name;
  G_OBJECT_CLASS(lf_cam_src_parent_class)->finalize(object);
}

static void lf_cam_src_class_init(LfCamSrcClass* klass) {
  GObjectClass* object_class = G_OBJECT_CLASS(klass);
  object_class->finalize = lf_cam_src_finalize;

  lf::Properties<settings_of, stats_of>::install(
      object_class,
      "state (stopped, opening, running, ended or lost), reason of the latest loss, losses, retries, "
      "dropped: frames left undecoded because this machine can't decode all, damaged: pictures that can't be shown, "
      "and capture-time: how it is known "
      "(source: as its source stamps frames; of RTSP sender-reports, or arrival as long as there are none); "
      "controls: what the camera has of them and of those in the rig (a number, auto, or FALSE: not taken), and "
      "control-values: their numbers now");

  GstElementClass* element_class = GST_ELEMENT_CLASS(klass);
  element_class->change_state = lf::callback<lf_cam_src_change_state>;
  element_class->send_event = lf::callback<lf_cam_src_send_event>;
  GST_BIN_CLASS(klass)->handle_message = lf::callback<lf_cam_src_handle_message>;
  GST_BIN_CLASS(klass)->element_added = lf::callback<lf::lock_decoder>;
  GST_BIN_CLASS(klass)->deep_element_added = lf::callback<lf_cam_src_deep_element_added>;
  gst_element_class_add_static_pad_template(element_class, &src_template);
  gst_element_class_set_static_metadata(
      element_class, "Light field camera source", "Source/Video",
      "One camera of a rig as a source of video: its device, file, still or image sequence, or the built-in scene",
      "gst-lightfield");
}

static void lf_cam_src_init(LfCamSrc* self) {
  self->settings = new Settings;
  self->service = new lf::CameraService;
  self->shedder = new std::shared_ptr<lf::CameraShedder>(std::make_shared<lf::CameraShedder>());
  self->keeper = new lf::CameraKeeper;
  self->name = new std::string;
  // A source also while it has no children, and never the clock of a pipeline.
  gst_bin_set_suppressed_flags(
      GST_BIN(self),
      static_cast<GstElementFlags>(GST_ELEMENT_FLAG_SOURCE | GST_ELEMENT_FLAG_SINK | GST_ELEMENT_FLAG_PROVIDE_CLOCK));
  GST_OBJECT_FLAG_SET(self, GST_ELEMENT_FLAG_SOURCE);
  GstPadTemplate* pad_template = gst_static_pad_template_get(&src_template);
  self->src = gst_ghost_pad_new_no_target_from_template("src", pad_template);
  gst_object_unref(pad_template);
  gst_pad_set_query_function(self->src, lf::callback<on_query>);
  gst_element_add_pad(GST_ELEMENT(self), self->src);
}
