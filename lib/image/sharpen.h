// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include "base/byte_buffer.h"
#include "base/rect.h"
#include "image/image.h"

namespace lf {

// Makes up for what bilinear sampling takes away: v + kSharpening (v - mean of its four neighbours), rounded and
// clamped, of every sample of each plane, neighbours repeated at the image's border. Bilinear samples of the result are
// two thirds of the way to Catmull-Rom's, at a fraction of the cost.
inline constexpr double kSharpening = 0.3;

// The image with its part in `rect` (inside it; x0, y0 even in kI420) sharpened, in `memory`, of which the rest is left
// as it is: of the same size and layout, what is between the colours of a pixel sharpened, too. Valid as long as
// `memory` is left alone. The same result with every instruction set.
ImageView sharpen(const ImageView& image, const Rect& rect, ByteBuffer& memory);
// All of it.
Image sharpened(const Image& image);

}  // namespace lf
