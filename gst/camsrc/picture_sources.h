// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <atomic>
#include <memory>

#include <gst/gst.h>

#include "camsrc/camera_chain.h"
#include "rig/rig.h"

namespace lf {

struct PictureSourceOptions {
  // size of the camera, pixels; a picture of another size ends the stream before it is decoded
  int width = 0, height = 0;
  int fps_n = 0, fps_d = 1;
  bool loop = false;  // loops, with continuous timestamps
  bool decode = true;
  std::shared_ptr<std::atomic<guint64>> damaged = {};
};

// Creates an element that reads a still image, an image sequence or a file with consecutive JPEG pictures. A missing or
// damaged picture loses only its frame, with one warning. If all pictures are damaged, the element posts an error. It
// is seekable, and its timestamps count from 0 at the frame rate.
GstElement* new_picture_source(const CameraSource& source, const PictureSourceOptions& options);

// Returns true if new_picture_source() has created this element.
bool is_picture_source(gpointer object);

// Creates a source that films the built-in scene with one camera: an endless stream of RGB frames at fps_n / fps_d > 0.
// The element is part of lfcamsrc and not for launch lines. Returns a floating reference.
//
// A frame shows the scene at its capture time, which is timestamp plus time offset of the camera. A live source stamps
// frames at multiples of the frame period on the clock, not on running time, and scene time is clock time. Therefore
// live cameras with the same clock capture the same instants, wherever and whenever they start. A slow live source
// skips frames.
//
// Frames may be ready before their time, so put a clocksync behind the source. The synchronisation of GstBaseSrc cannot
// be used, because it would shift the timestamps.
GstElement* new_scene_source(const Camera& camera, int fps_n, int fps_d, bool live);

}  // namespace lf
