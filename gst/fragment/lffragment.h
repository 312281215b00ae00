// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <gst/gst.h>

#define LF_TYPE_FRAGMENT (lf_fragment_get_type())
G_DECLARE_FINAL_TYPE(LfFragment, lf_fragment, LF, FRAGMENT, GstElement)

// Type of the sink pads, which each receive the video of one camera. The pad property "camera" names this camera.
#define LF_TYPE_FRAGMENT_PAD (lf_fragment_pad_get_type())
G_DECLARE_FINAL_TYPE(LfFragmentPad, lf_fragment_pad, LF, FRAGMENT_PAD, GstPad)

#define LF_TYPE_FRAGMENT_CODEC (lf_fragment_codec_get_type())
GType lf_fragment_codec_get_type(void);
#define LF_TYPE_FRAGMENT_RENDERER (lf_fragment_renderer_get_type())
GType lf_fragment_renderer_get_type(void);
