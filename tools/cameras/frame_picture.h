// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <gst/gst.h>

#include "image/image.h"
#include "image/jpeg_bytes.h"

namespace lf::cameras {

// The picture of a frame of lfcamsrc, raw or JPEG, as RGB. Throws Error for what can't be read. Any thread.
Image rgb_of(GstBuffer* buffer, GstCaps* caps);
inline Image rgb_of(GstSample* sample) { return rgb_of(gst_sample_get_buffer(sample), gst_sample_get_caps(sample)); }

// A raw frame in grey, `smaller` times as narrow and as low: the mean of so many pixels in a square, rounded down where
// there are fewer. Throws Error for what can't be read. Any thread.
GreyPicture small_grey_of(GstSample* sample, int smaller);
bool is_jpeg(GstSample* sample);
std::vector<uint8_t> bytes_of(GstSample* sample);

// Mean brightness, 0..255, of a picture that is RGB.
double brightness_of(const Image& rgb);

}  // namespace lf::cameras
