// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <gst/gst.h>

#include <optional>

namespace lf {

// The size in pixels of one view's picture, and the frame rate. 0: not set.
struct PictureForm {
  int width = 0, height = 0;
  int fps_n = 0, fps_d = 1;
  bool operator==(const PictureForm&) const = default;
};

// `set`, completed with the values of `usual`.
PictureForm with_usual(const PictureForm& set, const PictureForm& usual);

// The form of pictures for elements that accept `caps`: numbers in `set` stay, and all others are as near to `usual` as
// the first suitable structure allows. Where caps fix one side of the picture, the other side keeps the shape of
// `usual`. A picture of `caps` has columns x rows views; pictures of several views have even sides. Nothing if no
// structure is suitable. `set` and `usual` are of one view; `usual` is set as a whole.
std::optional<PictureForm> fit_to_caps(const GstCaps* caps, const PictureForm& set, const PictureForm& usual,
                                       int columns, int rows);

}  // namespace lf
