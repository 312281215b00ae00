// SPDX-License-Identifier: LGPL-2.1-or-later
#include "bins/camera_node_settings.h"

namespace lf {

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

}  // namespace lf
