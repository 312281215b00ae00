// SPDX-License-Identifier: LGPL-2.1-or-later

/**
 * SECTION:element-lfcamsrc
 * @title: lfcamsrc
 * @short_description: one camera of a rig as a source of video
 *
 * Gives the camera's `source` (a video file, an image sequence `dir/frame_%04d.jpg` counted from 0 or 1, or any other
 * GStreamer URI), else its `image` (a still), else the built-in scene, seen with the camera's pose and lens. Formats
 * stay as decoded wherever they are of the RGB family or I420. Frames have the size that the rig gives the camera;
 * anything else is an error. With `decode=false` JPEG video comes as it is.
 *
 * The stream carries the sticky event `lightfield-camera` (which camera of which rig) and each frame a
 * #GstReferenceTimestampMeta of `timestamp/x-lightfield-capture` with its true capture time: clock time where frames
 * are live, running time where not, plus the camera's time offset.
 *
 * ## Example launch line
 * |[
 * gst-launch-1.0 lfcamsrc rig=rig.json camera=5 ! videoconvert ! autovideosink
 * ]|
 */

#include "lfcamsrc.h"

#include <gst/video/video.h>

#include <algorithm>
#include <cstring>
#include <memory>
#include <string>
#include <vector>

#include "cam_src_settings.h"
#include "camera_chain.h"
#include "camera_source.h"
#include "camera_states.h"
#include "camera_stream.h"
#include "common.h"
#include "net_clock.h"

GST_DEBUG_CATEGORY_STATIC(lf_cam_src_debug);
#define GST_CAT_DEFAULT lf_cam_src_debug

namespace {

using Settings = lf::CamSrcSettings;

enum { kPropFirstSetting = 1, kPropNetClock = kPropFirstSetting + Settings::kNumProperties };

// One use of the children, from READY through PAUSED at most once.
struct Run {
  Settings settings;
  std::shared_ptr<const lf::Rig> rig;  // kept, so that the next camera finds it read already
  lf::CameraChain chain;
  std::shared_ptr<lf::CameraStream> stream;
  std::string wanted;  // of a device, in words
  bool used = false;   // has been in PAUSED: pads that come by and by have come
};

}  // namespace

struct _LfCamSrc {
  GstBin parent;
  GstPad* src;
  Settings* settings;  // under the object lock
  lf::NetClock* net_clock;
  Run* run;  // null in state NULL
};

G_DEFINE_TYPE_WITH_CODE(LfCamSrc, lf_cam_src, GST_TYPE_BIN,
                        GST_DEBUG_CATEGORY_INIT(lf_cam_src_debug, "lfcamsrc", 0, "one camera of a rig as a source"))
GST_ELEMENT_REGISTER_DEFINE(lfcamsrc, "lfcamsrc", GST_RANK_NONE, LF_TYPE_CAM_SRC)

static GstStaticPadTemplate src_template =
    GST_STATIC_PAD_TEMPLATE("src", GST_PAD_SRC, GST_PAD_ALWAYS,
                            GST_STATIC_CAPS(GST_VIDEO_CAPS_MAKE("{ " LF_RGB_FORMATS ", I420 }") "; image/jpeg"));

// A live stream may come up to one frame time after its stamps: a frame takes as long to be had.
static gboolean on_query(GstPad* pad, GstObject* parent, GstQuery* query) {
  if (!gst_pad_query_default(pad, parent, query)) return FALSE;
  if (GST_QUERY_TYPE(query) != GST_QUERY_LATENCY) return TRUE;
  gboolean live = FALSE;
  GstClockTime min = 0, max = GST_CLOCK_TIME_NONE;
  gst_query_parse_latency(query, &live, &min, &max);
  if (!live) return TRUE;
  GstCaps* caps = gst_pad_get_current_caps(pad);
  int fps_n = 0, fps_d = 1;
  if (caps) {
    gst_structure_get_fraction(gst_caps_get_structure(caps, 0), "framerate", &fps_n, &fps_d);
    gst_caps_unref(caps);
  }
  if (fps_n <= 0) fps_n = lf::kDefaultFps;
  gst_query_set_latency(query, live, std::max(min, gst_util_uint64_scale(GST_SECOND, fps_d, fps_n)), max);
  return TRUE;
}

// --- From NULL to READY and back ------------------------------------------------------------------------------------

static void remove_children(LfCamSrc* self) {
  gst_ghost_pad_set_target(GST_GHOST_PAD(self->src), nullptr);
  GstBin* bin = GST_BIN(self);
  while (bin->children) {
    GstElement* child = GST_ELEMENT(gst_object_ref(bin->children->data));
    gst_element_set_state(child, GST_STATE_NULL);
    gst_bin_remove(bin, child);
    gst_object_unref(child);
  }
  delete self->run;
  self->run = nullptr;
}

static Settings current_settings(LfCamSrc* self) {
  GST_OBJECT_LOCK(self);
  Settings settings = *self->settings;
  GST_OBJECT_UNLOCK(self);
  return settings;
}

static std::shared_ptr<const lf::Rig> open_rig(const std::string& path) {
  if (path.empty()) throw lf::Error("rig: not set");
  if (!g_file_test(path.c_str(), G_FILE_TEST_EXISTS)) throw lf::MissingFile(path + ": no such file");
  return lf::shared_rig(path);
}

// The errors say which camera of which rig they are about.
static lf::CameraSource find_source(const lf::Rig& rig, const lf::Camera& camera, const std::string& place) {
  try {
    return lf::find_camera_source(rig, camera);
  } catch (const lf::MissingFile& error) {
    throw lf::MissingFile(place + ": " + error.what());
  } catch (const lf::Error& error) {
    throw lf::Error(place + ": " + error.what());
  }
}

static void add_children(LfCamSrc* self, const Settings& settings) {
  const std::shared_ptr<const lf::Rig> rig = open_rig(settings.rig);
  const auto index = rig->index_of_id(settings.camera);
  if (!index) throw lf::Error(settings.rig + ": has no camera " + std::to_string(settings.camera));
  const lf::Camera& camera = rig->cameras[*index];
  std::string place = settings.rig + ": camera " + std::to_string(camera.id);
  if (!camera.name.empty()) place += " (" + camera.name + ")";
  const lf::CameraSource source = find_source(*rig, camera, place);
  if (!source.location.empty()) place += ": " + source.location;

  const lf::CameraChain chain = lf::build_camera_chain(GST_BIN(self), source, camera,
                                                       {.fps_n = settings.fps_n,
                                                        .fps_d = settings.fps_d,
                                                        .live = settings.is_live,
                                                        .loop = settings.loop,
                                                        .decode = settings.decode,
                                                        .latency = settings.latency});
  using Kind = lf::CameraSource::Kind;
  auto stream = std::make_shared<lf::CameraStream>(
      GST_ELEMENT(self), chain,
      lf::StreamOptions{.camera = *index,
                        .rig_hash = rig->hash(),
                        .width = camera.width,
                        .height = camera.height,
                        .time_offset = camera.time_offset,
                        .num_frames = settings.num_frames,
                        .seek_to_loop = settings.loop && (source.kind == Kind::kMatroska || source.kind == Kind::kUri),
                        .place = place});
  stream->watch();
  if (settings.is_live) stream->set_live();
  gst_ghost_pad_set_target(GST_GHOST_PAD(self->src), chain.out);
  std::string wanted;
  if (source.kind == Kind::kDevice) {
    wanted = std::to_string(camera.width) + "x" + std::to_string(camera.height);
    if (settings.fps_n > 0)
      wanted += " at " + std::to_string(settings.fps_n) + "/" + std::to_string(settings.fps_d) + " frames/s";
  }
  self->run = new Run{settings, rig, chain, stream, wanted};
}

// Children for the current settings. False, without children, after posting the reason.
static bool open_camera(LfCamSrc* self) {
  remove_children(self);
  try {
    add_children(self, current_settings(self));
    return true;
  } catch (const lf::MissingFile& error) {
    GST_ELEMENT_ERROR(self, RESOURCE, NOT_FOUND, ("%s", error.what()), (nullptr));
  } catch (const lf::MissingElement& error) {
    GST_ELEMENT_ERROR(self, CORE, MISSING_PLUGIN, ("element %s is not installed", error.what()), (nullptr));
  } catch (const lf::Error& error) {
    GST_ELEMENT_ERROR(self, RESOURCE, SETTINGS, ("%s", error.what()), (nullptr));
  }
  remove_children(self);
  return false;
}

// GstBin would start what is not linked yet in any order, and a decoder's first frame would find closed doors.
static void start_tail(const lf::CameraChain& chain) {
  for (auto element = chain.tail.rbegin(); element != chain.tail.rend(); ++element)
    gst_element_set_state(*element, GST_STATE_PAUSED);
}

// imagefreeze forgets its frame rate before it stops its thread, which may then divide by it: the thread is stopped
// here.
static void stop_tail(const lf::CameraChain& chain) {
  for (auto element = chain.tail.rbegin(); element != chain.tail.rend(); ++element) {
    GstPad* src = gst_element_get_static_pad(*element, "src");
    gst_pad_set_active(src, FALSE);
    gst_object_unref(src);
    gst_element_set_state(*element, GST_STATE_READY);
  }
}

static GstStateChangeReturn lf_cam_src_change_state(GstElement* element, GstStateChange transition) {
  LfCamSrc* self = LF_CAM_SRC(element);
  if (!self->net_clock->before(element, transition)) return GST_STATE_CHANGE_FAILURE;
  if (transition == GST_STATE_CHANGE_NULL_TO_READY) {
    if (!open_camera(self)) return GST_STATE_CHANGE_FAILURE;
  } else if (transition == GST_STATE_CHANGE_READY_TO_PAUSED) {
    const bool stale = self->run->used || self->run->settings != current_settings(self);
    if (stale && !open_camera(self)) return GST_STATE_CHANGE_FAILURE;
    self->run->used = true;
    start_tail(self->run->chain);
  } else if (transition == GST_STATE_CHANGE_PAUSED_TO_READY && self->run) {
    self->run->stream->stop();
    stop_tail(self->run->chain);
  }

  const GstStateChangeReturn result =
      lf::change_camera_state(GST_BIN(self), transition, GST_ELEMENT_CLASS(lf_cam_src_parent_class)->change_state);
  self->net_clock->after(element, transition);
  // A live child gives no frame before PLAYING, so that this comes in time.
  if (transition == GST_STATE_CHANGE_READY_TO_PAUSED && result == GST_STATE_CHANGE_NO_PREROLL)
    self->run->stream->set_live();
  if (transition == GST_STATE_CHANGE_READY_TO_NULL ||
      (transition == GST_STATE_CHANGE_NULL_TO_READY && result == GST_STATE_CHANGE_FAILURE))
    remove_children(self);
  return result;
}

// Errors of the children know nothing of cameras: says whose they are.
static void lf_cam_src_handle_message(GstBin* bin, GstMessage* message) {
  LfCamSrc* self = LF_CAM_SRC(bin);
  if (lf::take_decoder_message(bin, message)) return;
  if (GST_MESSAGE_TYPE(message) != GST_MESSAGE_ERROR || !self->run) {
    GST_BIN_CLASS(lf_cam_src_parent_class)->handle_message(bin, message);
    return;
  }
  if (self->run->stream->first_error()) {
    GError* error = nullptr;
    gchar* debug = nullptr;
    gst_message_parse_error(message, &error, &debug);
    std::string what = error->message;
    if (!self->run->wanted.empty() && debug && strstr(debug, "not-negotiated"))
      what =
          "it gives no pictures of " + self->run->wanted + "; v4l2-ctl --list-formats-ext lists what a V4L2 device has";
    gchar* text = g_strdup_printf("%s: %s", self->run->stream->place().c_str(), what.c_str());
    gst_element_message_full(GST_ELEMENT(self), GST_MESSAGE_ERROR, error->domain, error->code, text, debug, __FILE__,
                             GST_FUNCTION, __LINE__);  // takes the texts
    g_error_free(error);
  }
  gst_message_unref(message);
}

// "EOS, please" from the application (gst-launch-1.0 -e). Not all children take it while files loop; the next frame
// ends the stream in its place.
static gboolean lf_cam_src_send_event(GstElement* element, GstEvent* event) {
  LfCamSrc* self = LF_CAM_SRC(element);
  if (GST_EVENT_TYPE(event) != GST_EVENT_EOS)
    return GST_ELEMENT_CLASS(lf_cam_src_parent_class)->send_event(element, event);
  gst_event_unref(event);
  GST_STATE_LOCK(self);
  const bool running = self->run != nullptr;
  if (running) self->run->stream->end();
  GST_STATE_UNLOCK(self);
  return running;
}

// --- GObject --------------------------------------------------------------------------------------------------------

static void lf_cam_src_set_property(GObject* object, guint id, const GValue* value, GParamSpec*) {
  LfCamSrc* self = LF_CAM_SRC(object);
  if (id >= kPropNetClock) return self->net_clock->set(static_cast<lf::NetClock::Property>(id - kPropNetClock), value);
  GST_OBJECT_LOCK(self);
  self->settings->set(static_cast<Settings::Property>(id - kPropFirstSetting), value);
  GST_OBJECT_UNLOCK(self);
}

static void lf_cam_src_get_property(GObject* object, guint id, GValue* value, GParamSpec*) {
  LfCamSrc* self = LF_CAM_SRC(object);
  if (id >= kPropNetClock) return self->net_clock->get(static_cast<lf::NetClock::Property>(id - kPropNetClock), value);
  GST_OBJECT_LOCK(self);
  self->settings->get(static_cast<Settings::Property>(id - kPropFirstSetting), value);
  GST_OBJECT_UNLOCK(self);
}

static void lf_cam_src_finalize(GObject* object) {
  LfCamSrc* self = LF_CAM_SRC(object);
  delete self->run;
  delete self->settings;
  delete self->net_clock;
  G_OBJECT_CLASS(lf_cam_src_parent_class)->finalize(object);
}

static GstClock* lf_cam_src_provide_clock(GstElement* element) { return LF_CAM_SRC(element)->net_clock->provide(); }

static void lf_cam_src_class_init(LfCamSrcClass* klass) {
  GObjectClass* object_class = G_OBJECT_CLASS(klass);
  object_class->set_property = lf_cam_src_set_property;
  object_class->get_property = lf_cam_src_get_property;
  object_class->finalize = lf_cam_src_finalize;

  Settings::install(object_class, kPropFirstSetting);
  lf::NetClock::install(object_class, kPropNetClock);

  GstElementClass* element_class = GST_ELEMENT_CLASS(klass);
  element_class->change_state = lf_cam_src_change_state;
  element_class->provide_clock = lf_cam_src_provide_clock;
  element_class->send_event = lf_cam_src_send_event;
  GST_BIN_CLASS(klass)->handle_message = lf_cam_src_handle_message;
  GST_BIN_CLASS(klass)->element_added = lf::lock_decoder;
  gst_element_class_add_static_pad_template(element_class, &src_template);
  gst_element_class_set_static_metadata(
      element_class, "Light field camera source", "Source/Video",
      "One camera of a rig as a source of video: its device, file, still or image sequence, or the built-in scene",
      "gst-lightfield");
}

static void lf_cam_src_init(LfCamSrc* self) {
  self->settings = new Settings;
  self->net_clock = new lf::NetClock;
  // A source also while it has no children.
  gst_bin_set_suppressed_flags(
      GST_BIN(self),
      static_cast<GstElementFlags>(GST_ELEMENT_FLAG_SOURCE | GST_ELEMENT_FLAG_SINK | GST_ELEMENT_FLAG_PROVIDE_CLOCK));
  GST_OBJECT_FLAG_SET(self, GST_ELEMENT_FLAG_SOURCE | GST_ELEMENT_FLAG_PROVIDE_CLOCK);
  GstPadTemplate* pad_template = gst_static_pad_template_get(&src_template);
  self->src = gst_ghost_pad_new_no_target_from_template("src", pad_template);
  gst_object_unref(pad_template);
  gst_pad_set_query_function(self->src, on_query);
  gst_element_add_pad(GST_ELEMENT(self), self->src);
}
