// SPDX-License-Identifier: LGPL-2.1-or-later
#include "camsrc/cam_src_settings.h"

namespace lf {

void CamSrcSettings::install(GObjectClass* klass, guint first_id) {
  constexpr auto kFlags =
      static_cast<GParamFlags>(G_PARAM_READWRITE | G_PARAM_STATIC_STRINGS | GST_PARAM_MUTABLE_READY);
  g_object_class_install_property(
      klass, first_id + kRig,
      g_param_spec_string("rig", "Rig", "Path of the rig file (rig.json) that describes the camera", nullptr, kFlags));
  g_object_class_install_property(
      klass, first_id + kCamera,
      g_param_spec_uint("camera", "Camera", "Id of the camera in the rig file", 0, G_MAXUINT, 0, kFlags));
  g_object_class_install_property(
      klass, first_id + kFramerate,
      gst_param_spec_fraction("framerate", "Frame rate",
                              "Frames per second (0/1 = as the source has them; 15/1 for stills, image sequences and "
                              "the built-in scene, which have no rate of their own). Videos of another rate get frames "
                              "dropped or repeated",
                              0, 1, G_MAXINT, 1, 0, 1, kFlags));
  g_object_class_install_property(
      klass, first_id + kIsLive,
      g_param_spec_boolean(
          "is-live", "Is live",
          "Frames come at their time on the pipeline's clock, as from a device, in place of as fast as "
          "they are taken",
          FALSE, kFlags));
  g_object_class_install_property(
      klass, first_id + kLoop,
      g_param_spec_boolean("loop", "Loop",
                           "Videos and image sequences begin again at their end, with running time going on", FALSE,
                           kFlags));
  g_object_class_install_property(
      klass, first_id + kNumFrames,
      g_param_spec_int64("num-frames", "Number of frames",
                         "Frames after which the stream ends (-1 = when the source does: stills and the built-in scene "
                         "never do)",
                         -1, G_MAXINT64, -1, kFlags));

  g_object_class_install_property(
      klass, first_id + kDecode,
      g_param_spec_boolean("decode", "Decode",
                           "Raw video whatever the source is; without it JPEG video comes as it is, for lffragment to "
                           "decode where it needs it",
                           TRUE, kFlags));
  g_object_class_install_property(
      klass, first_id + kLatency,
      g_param_spec_uint("latency", "Latency",
                        "Network cameras (RTSP): how long, in milliseconds, packets are waited for and put in order", 0,
                        60000, 200, kFlags));
  g_object_class_install_property(
      klass, first_id + kRetry,
      g_param_spec_boolean("retry", "Retry",
                           "A camera that fails is opened again, after half a second at first and after ten seconds at "
                           "most, in place of an error: the element messages lightfield-camera-lost and "
                           "lightfield-camera-found and a warning tell",
                           FALSE, kFlags));
}

void CamSrcSettings::set(Property property, const GValue* value) {
  switch (property) {
    case kRig: rig = g_value_get_string(value) ? g_value_get_string(value) : ""; break;
    case kCamera: camera = g_value_get_uint(value); break;
    case kFramerate:
      fps_n = gst_value_get_fraction_numerator(value);
      fps_d = gst_value_get_fraction_denominator(value);
      break;
    case kIsLive: is_live = g_value_get_boolean(value); break;
    case kLoop: loop = g_value_get_boolean(value); break;
    case kDecode: decode = g_value_get_boolean(value); break;
    case kLatency: latency = g_value_get_uint(value); break;
    case kRetry: retry = g_value_get_boolean(value); break;
    case kNumFrames: num_frames = g_value_get_int64(value); break;
    case kNumProperties: break;
  }
}

void CamSrcSettings::get(Property property, GValue* value) const {
  switch (property) {
    case kRig: g_value_set_string(value, rig.empty() ? nullptr : rig.c_str()); break;
    case kCamera: g_value_set_uint(value, camera); break;
    case kFramerate: gst_value_set_fraction(value, fps_n, fps_d); break;
    case kIsLive: g_value_set_boolean(value, is_live); break;
    case kLoop: g_value_set_boolean(value, loop); break;
    case kDecode: g_value_set_boolean(value, decode); break;
    case kLatency: g_value_set_uint(value, latency); break;
    case kRetry: g_value_set_boolean(value, retry); break;
    case kNumFrames: g_value_set_int64(value, num_frames); break;
    case kNumProperties: break;
  }
}

}  // namespace lf
