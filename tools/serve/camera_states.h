// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <gst/gst.h>

#include <cstdint>
#include <string>

namespace lf::serve {

// How the cameras of an lfcameranode are. Any thread.
struct CameraStates {
  uint32_t count = 0, working = 0;  // working: not lost, as far as is known
};
CameraStates camera_states(GstElement* node);
// Why the camera of this id was lost; "" where nothing is known.
std::string camera_problem(GstElement* node, uint32_t id);

}  // namespace lf::serve
