// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <gst/gst.h>

#include "image/image.h"

namespace lf::cameras {

// The picture of a frame of lfcamsrc, raw or JPEG, as RGB. Throws Error for what can't be read. Any thread.
Image rgb_of(GstBuffer* buffer, GstCaps* caps);
inline Image rgb_of(GstSample* sample) { return rgb_of(gst_sample_get_buffer(sample), gst_sample_get_caps(sample)); }

// Mean brightness, 0..255, of a picture that is RGB.
double brightness_of(const Image& rgb);

}  // namespace lf::cameras
