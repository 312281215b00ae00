// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <gst/gst.h>

G_BEGIN_DECLS

#define LF_TYPE_VIEW_SRC (lf_view_src_get_type())
G_DECLARE_FINAL_TYPE(LfViewSrc, lf_view_src, LF, VIEW_SRC, GstBin)
GST_ELEMENT_REGISTER_DECLARE(lfviewsrc)

G_END_DECLS
