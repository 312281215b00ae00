// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <span>
#include <string>

#include <gst/gst.h>

G_BEGIN_DECLS

#define LF_TYPE_CAMERA_NODE (lf_camera_node_get_type())
G_DECLARE_FINAL_TYPE(LfCameraNode, lf_camera_node, LF, CAMERA_NODE, GstBin)
GST_ELEMENT_REGISTER_DECLARE(lfcameranode)

G_END_DECLS

namespace lf {

// Why cameras were lost, for a person to read. A reason is "PLACE: WHY", as lfcamsrc tells it, and its last part is the
// why. Reasons stand as they are, in their order, with `separator` between them; but those of more than three cameras
// with one and the same why are told once, where the first of them is: "64 cameras: WHY (PLACE and others)".
std::string grouped_reasons(std::span<const std::string> reasons, const std::string& separator);

}  // namespace lf
