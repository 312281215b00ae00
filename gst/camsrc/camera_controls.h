// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <string>

#include <gst/gst.h>

#include "rig/rig_json.h"

namespace lf {

// Sets controls of a source, an element or a bin of elements, before it opens its device: by `extra-controls` where an
// element has that (v4l2src), else by properties (libcamerasrc, aravissrc), else by GstColorBalance.
void apply_controls(GstElement* source, const Controls& controls);

// What the controls of an open source are: for each one known of it, and each of `wanted`, a field with a number, the
// text "auto", or FALSE where the source has no such control. Owned by the caller, as is what follows.
GstStructure* read_controls(GstElement* source, const Controls& wanted);
// The numbers in use now, also of those that the camera decides by itself.
GstStructure* read_control_values(GstElement* source, const Controls& wanted);

// Value of a V4L2 control by its id; nothing where the device does not have it.
using ReadV4l2 = std::function<std::optional<int32_t>(uint32_t id)>;

// The fields of v4l2src's extra-controls for `controls`; owned by the caller. Kernels name some controls differently:
// all names are given, and v4l2src passes over those that a device does not have. Switches come before what they allow.
GstStructure* v4l2_extra_controls(const Controls& controls);

// A control as people have it: its number, and whether the camera decides by itself. Nothing without it.
struct V4l2Control {
  std::optional<double> value;
  bool automatic = false;
};
std::optional<V4l2Control> read_v4l2_control(const std::string& name, const ReadV4l2& read);

// Reads the controls of an open device, `handle` (v4l2src's device-fd).
ReadV4l2 v4l2_reader(int handle);

}  // namespace lf
