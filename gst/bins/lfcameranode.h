// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <gst/gst.h>

G_BEGIN_DECLS

#define LF_TYPE_CAMERA_NODE (lf_camera_node_get_type())
G_DECLARE_FINAL_TYPE(LfCameraNode, lf_camera_node, LF, CAMERA_NODE, GstBin)
GST_ELEMENT_REGISTER_DECLARE(lfcameranode)

G_END_DECLS
