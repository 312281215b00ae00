// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <gst/gst.h>

G_BEGIN_DECLS

#define LF_TYPE_CAM_SRC (lf_cam_src_get_type())
G_DECLARE_FINAL_TYPE(LfCamSrc, lf_cam_src, LF, CAM_SRC, GstBin)
GST_ELEMENT_REGISTER_DECLARE(lfcamsrc)

G_END_DECLS
