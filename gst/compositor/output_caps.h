// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <gst/gst.h>

#include <string>

#include "image/image.h"
#include "view/view_set.h"

namespace lf {

// Fixed caps of a picture of width x height pixels out of `downstream`, what is taken there; of the fragments' own
// family where `family` is known; null if there are none. Of a set in this layout that GStreamer has a multiview-mode
// for they have that. YCbCr has the range of cameras, or that of video where
// downstream wants BT.601 so: nobody then has to convert it (GstVideoConverter 1.22 would leave the range as it is).
// The frame rate is that of the requests that come to the pad `request`. In a graphics card's memory where downstream
// takes no other. Owned by the caller.
GstCaps* choose_output_caps(GstCaps* downstream, GstPad* request, PixelFamily family, int width, int height,
                            SetLayout layout);

// Why choose_output_caps() finds no caps, and what to do: a sentence for a person.
struct CapsMismatch {
  bool is_of_size_or_rate = false;  // pictures of another size or rate would be accepted
  std::string text;
};
CapsMismatch explain_mismatch(const GstCaps* downstream, GstPad* request, PixelFamily family, int width, int height);

// Video of this family, or of any family where it is kNone, in any memory. Owned by the caller.
GstCaps* offered_caps(PixelFamily family);

// Whether video of these caps, of all of them, is in a graphics card's memory.
bool is_in_card(const GstCaps* caps);

}  // namespace lf
