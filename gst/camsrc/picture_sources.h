// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <atomic>
#include <memory>

#include <gst/gst.h>

#include "camsrc/camera_chain.h"
#include "rig/rig.h"

namespace lf {

struct PictureSourceOptions {
  int width = 0, height = 0;  // of the camera, pixels; a picture of another size ends the stream before it is decoded
  int fps_n = 0, fps_d = 1;
  bool loop = false;                                   // begins again behind the last picture, with time going on
  bool decode = true;                                  // false: JPEG pictures stay JPEG
  std::shared_ptr<std::atomic<guint64>> damaged = {};  // counts the pictures that can't be shown
};

// A source of a still, an image sequence or a JPEG stream: pictures with stamps that count from 0 at the frame rate. A
// picture that is missing or damaged costs its own frame and one warning; none at all is an error. Seekable.
GstElement* new_picture_source(const CameraSource& source, const PictureSourceOptions& options);

bool is_picture_source(gpointer object);

// A camera of a rig that films the built-in scene: RGB frames k = 0, 1, ... at fps_n / fps_d > 0, without end. Part of
// lfcamsrc, not an element for launch lines. Returns a floating reference.
//
// A frame shows the scene at its capture time, stamp + the camera's time offset. The stamps of a live source are the
// multiples of the frame time on the clock itself (not on the running time), and the scene's time is the clock's, so
// that live cameras of one clock film the same instants of the same scene wherever and whenever they are started. A
// live source that can't keep up leaves frames out. A frame comes when it is ready, which may be before its time: put a
// clocksync behind (GstBaseSrc's own waiting would shift the stamps).
GstElement* new_scene_source(const Camera& camera, int fps_n, int fps_d, bool live);

}  // namespace lf
