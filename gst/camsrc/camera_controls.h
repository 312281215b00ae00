// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <string>

#include <gst/gst.h>

#include "rig/rig_json.h"

namespace lf {

// Sets the camera controls of the rig file, such as exposure and gain, before the device is opened. `source` is an
// element, or a bin that contains the element. Each kind of source has its own interface: the function tries the
// property `extra-controls` (v4l2src), then a property for each control (libcamerasrc, aravissrc), then
// GstColorBalance.
void apply_controls(GstElement* source, const Controls& controls);

// Reads the controls of an open source, to report in `stats` which of them the camera has accepted. The result has one
// field for each known control and for each control in `wanted`. Its value is a number, the text "auto" if the camera
// chooses the value, or FALSE if the source lacks the control. The caller owns the result.
GstStructure* read_controls(GstElement* source, const Controls& wanted);
// Does the same, but returns the present number instead of "auto" for values that the camera chooses. The caller owns
// the result.
GstStructure* read_control_values(GstElement* source, const Controls& wanted);

// Reads one V4L2 control, by its id such as V4L2_CID_GAIN. Returns nothing if the device lacks the control.
using ReadV4l2 = std::function<std::optional<int32_t>(uint32_t id)>;

// Converts `controls` to a value for the property `extra-controls` of v4l2src, which the caller owns. Some controls
// have different names in different kernel versions; the result contains all of these names, because v4l2src skips
// unknown names. A control that switches a mode, such as manual exposure, comes before the values that only have an
// effect in this mode.
GstStructure* v4l2_extra_controls(const Controls& controls);

// The value of a control. `automatic` is true if the camera chooses the value.
struct ControlState {
  std::optional<double> value;
  bool automatic = false;
};
std::optional<ControlState> read_v4l2_control(const std::string& name, const ReadV4l2& read);

// Reads the controls of an open device. `handle` is the file descriptor (device-fd of v4l2src).
ReadV4l2 v4l2_reader(int handle);

}  // namespace lf
