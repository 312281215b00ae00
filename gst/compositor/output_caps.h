// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <gst/gst.h>

#include "image/image.h"

namespace lf {

// Fixed caps of a picture of width x height pixels out of `downstream`, what is taken there; of the fragments' own
// family where `family` is known; null if there are none. The frame rate is that of the requests that come to the pad
// `request`. Owned by the caller.
GstCaps* choose_output_caps(GstCaps* downstream, GstPad* request, PixelFamily family, int width, int height);

}  // namespace lf
