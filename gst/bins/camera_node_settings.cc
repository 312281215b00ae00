// SPDX-License-Identifier: LGPL-2.1-or-later
#include "bins/camera_node_settings.h"

namespace lf {

void CameraNodeSettings::install(GObjectClass* klass, guint first_id) {
  constexpr auto kFlags =
      static_cast<GParamFlags>(G_PARAM_READWRITE | G_PARAM_STATIC_STRINGS | GST_PARAM_MUTABLE_READY);
  g_object_class_install_property(
      klass, first_id + kRig,
      g_param_spec_string("rig", "Rig",
                          "Path of the rig file (rig.json) of the whole array. Set while running, it is read again and "
                          "serves from the next request on, if it has the same cameras with the same sources; time "
                          "offsets count from the next start on",
                          nullptr,
                          GParamFlags(G_PARAM_READWRITE | G_PARAM_STATIC_STRINGS | GST_PARAM_MUTABLE_PLAYING)));
  g_object_class_install_property(
      klass, first_id + kCameras,
      g_param_spec_string("cameras", "Cameras",
                          "Ids of the cameras of this node, such as \"0-15,20\" (empty = all of the rig)", "", kFlags));
  g_object_class_install_property(
      klass, first_id + kFramerate,
      gst_param_spec_fraction(
          "framerate", "Frame rate",
          "Frames per second of each camera (0/1 = as its source has them, 15/1 where that has none)", 0, 1, G_MAXINT,
          1, 0, 1, kFlags));
  g_object_class_install_property(
      klass, first_id + kIsLive,
      g_param_spec_boolean("is-live", "Is live",
                           "Frames come at their time on the pipeline's clock, in place of when a request needs them",
                           FALSE, kFlags));
  g_object_class_install_property(
      klass, first_id + kLoop,
      g_param_spec_boolean("loop", "Loop", "Videos and image sequences begin again at their end", FALSE, kFlags));
  g_object_class_install_property(
      klass, first_id + kNode,
      g_param_spec_uint("node", "Node", "Number of this node in its answers; each node of an array has its own", 0,
                        G_MAXUINT, 0, kFlags));
  g_object_class_install_property(
      klass, first_id + kDecode,
      g_param_spec_boolean("decode", "Decode",
                           "JPEG video is decoded frame by frame, in place of where a request looks", FALSE, kFlags));
  g_object_class_install_property(
      klass, first_id + kLatency,
      g_param_spec_uint("latency", "Latency",
                        "Network cameras (RTSP): how long, in milliseconds, packets are waited for and put in order", 0,
                        60000, 200, kFlags));
  g_object_class_install_property(
      klass, first_id + kRetry,
      g_param_spec_boolean(
          "retry", "Retry",
          "Live cameras that fail are opened again, after half a second at first and after ten seconds "
          "at most; else they are lost for good, as files are that are not live",
          TRUE, kFlags));
}

void CameraNodeSettings::set(Property property, const GValue* value) {
  switch (property) {
    case kRig: rig = g_value_get_string(value) ? g_value_get_string(value) : ""; break;
    case kCameras: cameras = g_value_get_string(value) ? g_value_get_string(value) : ""; break;
    case kFramerate:
      fps_n = gst_value_get_fraction_numerator(value);
      fps_d = gst_value_get_fraction_denominator(value);
      break;
    case kIsLive: is_live = g_value_get_boolean(value); break;
    case kLoop: loop = g_value_get_boolean(value); break;
    case kDecode: decode = g_value_get_boolean(value); break;
    case kLatency: latency = g_value_get_uint(value); break;
    case kRetry: retry = g_value_get_boolean(value); break;
    case kNode: node = g_value_get_uint(value); break;
    case kNumProperties: break;
  }
}

void CameraNodeSettings::get(Property property, GValue* value) const {
  switch (property) {
    case kRig: g_value_set_string(value, rig.empty() ? nullptr : rig.c_str()); break;
    case kCameras: g_value_set_string(value, cameras.c_str()); break;
    case kFramerate: gst_value_set_fraction(value, fps_n, fps_d); break;
    case kIsLive: g_value_set_boolean(value, is_live); break;
    case kLoop: g_value_set_boolean(value, loop); break;
    case kDecode: g_value_set_boolean(value, decode); break;
    case kLatency: g_value_set_uint(value, latency); break;
    case kRetry: g_value_set_boolean(value, retry); break;
    case kNode: g_value_set_uint(value, node); break;
    case kNumProperties: break;
  }
}

}  // namespace lf
