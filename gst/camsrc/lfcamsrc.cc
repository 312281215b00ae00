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

#include <gst/video/video.h>

#include <algorithm>
#include <cstring>
#include <memory>
#include <string>

#include "base/schedule.h"
#include "camsrc/camera_states.h"
#include "camsrc/lfcamsrc_private.h"
#include "camsrc/lfpicturesrc.h"
#include "camsrc/message_secrets.h"
#include "common/common.h"

GST_DEBUG_CATEGORY(lf_cam_src_debug);
#define GST_CAT_DEFAULT lf_cam_src_debug

using Settings = lf::CamSrcSettings;

G_DEFINE_TYPE_WITH_CODE(LfCamSrc, lf_cam_src, GST_TYPE_BIN,
                        GST_DEBUG_CATEGORY_INIT(lf_cam_src_debug, "lfcamsrc", 0, "one camera of a rig as a source"))
GST_ELEMENT_REGISTER_DEFINE(lfcamsrc, "lfcamsrc", GST_RANK_NONE, LF_TYPE_CAM_SRC)

static GstStaticPadTemplate src_template = GST_STATIC_PAD_TEMPLATE(
    "src", GST_PAD_SRC, GST_PAD_ALWAYS,
    GST_STATIC_CAPS(GST_VIDEO_CAPS_MAKE("{ " LF_RGB_FORMATS
                                        ", I420 }") "; image/jpeg; " LF_CARD_VIDEO_CAPS("{ " LF_CAMERA_FORMATS " }")));

GstClockTime lf_cam_src_period(LfCamSrc* self) {
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

// --- States ---------------------------------------------------------------------------------------------------------

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
    if (self->service->state() == lf::CameraService::State::kStopped) self->service->start();
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
  message = lf::hide_secrets(message);
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
  } else if (self->service->state() == lf::CameraService::State::kLost) {
    lf_cam_src_end_lost(self);
    running = true;
  }
  return running;
}

// --- GObject --------------------------------------------------------------------------------------------------------

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
