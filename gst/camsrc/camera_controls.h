// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <string>

#include <gst/gst.h>

#include "rig/rig_json.h"

namespace lf {

// Sets the controls of an element, or of all elements in a bin, before the device is opened. Tries the property
// `extra-controls` (v4l2src), then other properties (libcamerasrc, aravissrc), then GstColorBalance.
void apply_controls(GstElement* source, const Controls& controls);

// Returns the controls of an open source: a field for each known control and for each control in `wanted`. A value is a
// number, the text "auto", or FALSE if the source lacks the control. The caller owns the result.
GstStructure* read_controls(GstElement* source, const Controls& wanted);
// Returns the current values, including values that the camera has chosen automatically. The caller owns the result.
GstStructure* read_control_values(GstElement* source, const Controls& wanted);

using ReadV4l2 = std::function<std::optional<int32_t>(uint32_t id)>;

// Returns `extra-controls` of v4l2src for `controls`; the caller owns the result. Some controls have different names in
// different kernel versions. The result has all of these names, because v4l2src skips unknown names. Mode switches
// precede the values that they enable.
GstStructure* v4l2_extra_controls(const Controls& controls);

struct V4l2Control {
  std::optional<double> value;
  bool automatic = false;
};
std::optional<V4l2Control> read_v4l2_control(const std::string& name, const ReadV4l2& read);

// Reads the controls of an open device. `handle` is the file descriptor (device-fd of v4l2src).
ReadV4l2 v4l2_reader(int handle);

}  // namespace lf
