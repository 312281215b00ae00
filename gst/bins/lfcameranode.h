// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <span>
#include <string>

#include <gst/gst.h>

#define LF_TYPE_CAMERA_NODE (lf_camera_node_get_type())
G_DECLARE_FINAL_TYPE(LfCameraNode, lf_camera_node, LF, CAMERA_NODE, GstBin)

namespace lf {

// Combines the reasons of several lost cameras into one text for a message. Each reason has the form "PLACE: WHY". If
// more than three cameras have the same WHY, they become one entry, for example "64 cameras: WHY (PLACE and others)".
// The entries keep their order and are joined by `separator`.
std::string grouped_reasons(std::span<const std::string> reasons, const std::string& separator);

}  // namespace lf
