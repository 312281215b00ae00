// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <gst/gst.h>

#include "rig/camera_controls.h"

namespace lf {

// Sets controls of a source, an element or a bin of elements, before it opens its device: by `extra-controls` where an
// element has that (v4l2src), else by properties (libcamerasrc, aravissrc), else by GstColorBalance.
void apply_controls(GstElement* source, const Controls& controls);

// What the controls of an open source are: for each one known of it, and each of `wanted`, a field with a number, the
// text "auto", or FALSE where the source has no such control. Owned by the caller, as is what follows.
GstStructure* read_controls(GstElement* source, const Controls& wanted);
// The numbers in use now, also of those that the camera decides by itself.
GstStructure* read_control_values(GstElement* source, const Controls& wanted);

}  // namespace lf
