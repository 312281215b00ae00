// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <span>

#include "node/camera_access.h"

namespace lf {

// Pixels of a camera's image that are asked for.
struct PixelSource {
  Source source;  // has an image
  Rect rect;      // part of the image; x0, y0 even
};

// An answer with these pixels as they are: plain fragments, raw (quality 0) or JPEG in strips of `strip_pixels`. Throws
// Error for images that are not of the size the rig says or of the family of the header, and as AnswerWriter does.
RenderedAnswer pixel_answer(const wire::AnswerHeader& header, std::span<const PixelSource> sources, int quality,
                            int strip_pixels = wire::kStripPixels, ByteBuffer memory = {},
                            const ParallelFor& parallel = serial_for);

}  // namespace lf
