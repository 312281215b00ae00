// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <gst/video/video.h>

#include "image/image.h"

namespace lf {

// The pixel family of a raw video format, kNone if it is neither in the RGB family nor I420, NV12 or GRAY8.
PixelFamily family_of(const GstVideoInfo& info);
// At which bytes of a pixel R, G and B are in a format of the RGB family.
RgbLayout rgb_layout(const GstVideoInfo& info);
// Sets what I420 means inside the system: full-range BT.601, centred chroma.
void set_system_colorimetry(GstVideoInfo& info);
// Whether it is YCbCr with the head and foot room of video, in place of what I420 means inside the system.
bool has_video_levels(const GstVideoInfo& info);

}  // namespace lf
