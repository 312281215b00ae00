// SPDX-License-Identifier: LGPL-2.1-or-later
#include "viewrequest/view_request_settings.h"

#include "rig/rig.h"
#include "view/view.h"

namespace lf {
namespace {

constexpr GstClockTime kMostCaptureDelay = 60 * GST_SECOND;
constexpr double kMostEyeOffset = 1e6;  // metres

std::string text(const GValue* value) {
  const gchar* s = g_value_get_string(value);
  return s ? s : "";
}

void set_text(GValue* value, const std::string& s) { g_value_set_string(value, s.empty() ? nullptr : s.c_str()); }

GParamSpec* make_pspec(ViewRequestSettings::Property property) {
  const auto ready = GParamFlags(G_PARAM_READWRITE | G_PARAM_STATIC_STRINGS | GST_PARAM_MUTABLE_READY);
  const auto playing = GParamFlags(G_PARAM_READWRITE | G_PARAM_STATIC_STRINGS | GST_PARAM_MUTABLE_PLAYING);
  const ViewRequestSettings initial;
  switch (property) {
    case ViewRequestSettings::kLocation:
      return g_param_spec_string("location", "Location",
                                 "A views.json file to ask for, view by view; without it the view is made of the "
                                 "properties",
                                 nullptr, ready);
    case ViewRequestSettings::kRig:
      return g_param_spec_string(
          "rig", "Rig",
          "The rig.json file the view is of: requests carry its hash, and what is not set of "
          "the view is chosen to suit it. Set while running, it is read again and its hash is that "
          "of the next request",
          nullptr, playing);
    case ViewRequestSettings::kViewId:
      return g_param_spec_uint("view-id", "View id", "Id of the view, that of its lfcompositor", 0, G_MAXUINT,
                               initial.view_id, ready);
    case ViewRequestSettings::kWidth:
      return g_param_spec_int("width", "Width",
                              "Width of the view in pixels, without location (0: that of the rig's cameras, without "
                              "rig 640)",
                              0, kMaxImageSize, initial.width, playing);
    case ViewRequestSettings::kHeight:
      return g_param_spec_int("height", "Height",
                              "Height of the view in pixels, without location (0: that of the rig's cameras, without "
                              "rig 480)",
                              0, kMaxImageSize, initial.height, playing);
    case ViewRequestSettings::kFramerate:
      return gst_param_spec_fraction("framerate", "Frame rate",
                                     "Requests per second, also that of the capture schedule; views of a file that "
                                     "have times of their own keep these",
                                     1, G_MAXINT, G_MAXINT, 1, initial.fps_n, initial.fps_d, ready);
    case ViewRequestSettings::kCaptureDelay:
      return g_param_spec_uint64("capture-delay", "Capture delay",
                                 "Live: how old, in nanoseconds, the capture time asked for is at least; long enough "
                                 "for frames of that time to have reached the nodes. It is told as latency. -1 "
                                 "(GST_CLOCK_TIME_NONE) is automatic: what the nodes of this process find that their "
                                 "cameras need, followed by LATENCY messages",
                                 0, G_MAXUINT64, initial.capture_delay, ready);
    case ViewRequestSettings::kNavigation:
      return g_param_spec_boolean("navigation", "Navigation",
                                  "Let GstNavigation events move the view: drag orbits, shift-drag pans, the wheel "
                                  "dollies, with ctrl it focuses; keys are arrows, w s a d q e, + -, [ ], r",
                                  initial.navigation, playing);
    case ViewRequestSettings::kKeepVisible:
      return g_param_spec_boolean(
          "keep-visible", "Keep visible",
          "Mouse and keys, but with shift, lose sight of no more than half of what is seen from "
          "the start: the view is held back. Needs rig",
          initial.keep_visible, playing);
    case ViewRequestSettings::kQuality:
      return g_param_spec_uint("quality", "Quality",
                               "Quality of the JPEG in which answers come over links (0: uncompressed)", 0, 100,
                               initial.quality, playing);
    case ViewRequestSettings::kOutOfService:
      return g_param_spec_string("out-of-service", "Out of service",
                                 "Ids of cameras that the nodes are to do without, like \"0-3,7\"; needs rig", nullptr,
                                 playing);
    case ViewRequestSettings::kNavigationFrom:
      return g_param_spec_string("navigation-from", "Navigation from",
                                 "Name of an element of this pipeline that the pictures pass: mouse and keys of their "
                                 "window steer the view, though the pictures come from another host",
                                 nullptr, ready);
    case ViewRequestSettings::kAccess:
      return g_param_spec_enum("access", "Access",
                               "What the cameras know: behind each request go commands for those that do not find out "
                               "themselves what they have to give (lffragment access); needs rig",
                               LF_TYPE_ACCESS, static_cast<gint>(initial.access), ready);
    case ViewRequestSettings::kEager:
      return g_param_spec_boolean(
          "eager", "Eager",
          "Live, without location: once the view is changed the next request does not wait for its turn, but for a "
          "quarter of a frame after the turn before, and asks for the newest capture there is. No more requests are "
          "made for it",
          initial.eager, playing);
    case ViewRequestSettings::kEyeOffset:
      return g_param_spec_double("eye-offset", "Eye offset",
                                 "How far to the right of the view its picture is made from, in metres, as by one of "
                                 "two eyes that fly together; the focal plane stays that of the view",
                                 -kMostEyeOffset, kMostEyeOffset, initial.eye_offset, playing);
    case ViewRequestSettings::kFocusContinuous:
      return g_param_spec_boolean(kFocusContinuous, "Focus continuous",
                                  "Keep the place of the view in focus that a click or focus-at named last (before: "
                                  "the middle), as what is seen "
                                  "there moves: from the focal surface of its lfcompositor, or by a sweep of depths, "
                                  "in a small view beside one of eight requests",
                                  initial.focus_continuous, playing);
    case ViewRequestSettings::kNearestCameras:
      return g_param_spec_uint(
          "nearest-cameras", "Nearest cameras",
          "Without aperture: blend about as many cameras a pixel, weighed by angle, resolution and "
          "field of view, for arrays without structure (0: three cameras, blended by the mesh)",
          0, Blending::kMaxNearest, initial.nearest_cameras, playing);
    case ViewRequestSettings::kLoop:
    default:
      return g_param_spec_boolean("loop", "Loop", "Begin the file of location again at its end", initial.loop, ready);
  }
}

}  // namespace

void ViewRequestSettings::install(GObjectClass* klass, guint first_id) {
  for (int i = 0; i < kNumProperties; i++)
    g_object_class_install_property(klass, first_id + i, make_pspec(static_cast<Property>(i)));
}

void ViewRequestSettings::set(Property property, const GValue* value) {
  switch (property) {
    case kLocation: location = text(value); break;
    case kRig: rig = text(value); break;
    case kViewId: view_id = g_value_get_uint(value); break;
    case kWidth: width = g_value_get_int(value); break;
    case kHeight: height = g_value_get_int(value); break;
    case kFramerate:
      fps_n = gst_value_get_fraction_numerator(value);
      fps_d = gst_value_get_fraction_denominator(value);
      break;
    case kCaptureDelay:
      capture_delay = g_value_get_uint64(value);
      if (GST_CLOCK_TIME_IS_VALID(capture_delay)) capture_delay = MIN(capture_delay, kMostCaptureDelay);
      break;
    case kNavigation: navigation = g_value_get_boolean(value); break;
    case kKeepVisible: keep_visible = g_value_get_boolean(value); break;
    case kQuality: quality = g_value_get_uint(value); break;
    case kOutOfService: out_of_service = text(value); break;
    case kLoop: loop = g_value_get_boolean(value); break;
    case kNavigationFrom: navigation_from = text(value); break;
    case kAccess: access = static_cast<Access>(g_value_get_enum(value)); break;
    case kEager: eager = g_value_get_boolean(value); break;
    case kEyeOffset: eye_offset = g_value_get_double(value); break;
    case kFocusContinuous: focus_continuous = g_value_get_boolean(value); break;
    case kNearestCameras: nearest_cameras = g_value_get_uint(value); break;
    case kNumProperties: break;
  }
}

void ViewRequestSettings::get(Property property, GValue* value) const {
  switch (property) {
    case kLocation: set_text(value, location); break;
    case kRig: set_text(value, rig); break;
    case kViewId: g_value_set_uint(value, view_id); break;
    case kWidth: g_value_set_int(value, width); break;
    case kHeight: g_value_set_int(value, height); break;
    case kFramerate: gst_value_set_fraction(value, fps_n, fps_d); break;
    case kCaptureDelay: g_value_set_uint64(value, capture_delay); break;
    case kNavigation: g_value_set_boolean(value, navigation); break;
    case kKeepVisible: g_value_set_boolean(value, keep_visible); break;
    case kQuality: g_value_set_uint(value, quality); break;
    case kOutOfService: set_text(value, out_of_service); break;
    case kLoop: g_value_set_boolean(value, loop); break;
    case kNavigationFrom: set_text(value, navigation_from); break;
    case kAccess: g_value_set_enum(value, static_cast<gint>(access)); break;
    case kEager: g_value_set_boolean(value, eager); break;
    case kEyeOffset: g_value_set_double(value, eye_offset); break;
    case kFocusContinuous: g_value_set_boolean(value, focus_continuous); break;
    case kNearestCameras: g_value_set_uint(value, nearest_cameras); break;
    case kNumProperties: break;
  }
}

}  // namespace lf
