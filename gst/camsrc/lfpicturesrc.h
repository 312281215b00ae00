// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <gst/gst.h>

#include <atomic>
#include <memory>

#include "camsrc/camera_source.h"

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

}  // namespace lf
