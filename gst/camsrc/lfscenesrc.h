// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <gst/gst.h>

#include "rig/rig.h"

namespace lf {

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
