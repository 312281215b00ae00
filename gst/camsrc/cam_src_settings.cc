// SPDX-License-Identifier: LGPL-2.1-or-later
#include "camsrc/cam_src_settings.h"

namespace lf {

PropertyTable<CamSrcSettings>& CamSrcSettings::properties() {
  using S = CamSrcSettings;
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

}  // namespace lf
