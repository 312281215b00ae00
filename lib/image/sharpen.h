// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include "image/image.h"
#include "render/rect.h"

namespace lf {

// How cameras' images are sampled.
enum class Resampling {
  kBilinear,
  kSharpened,  // bilinear, of sharpened images
};

// Makes up for what bilinear sampling takes away: v + kSharpening (v - mean of its four neighbours), rounded and clamped,
// of every sample of each plane, neighbours repeated at the image's border. Bilinear samples of the result are two thirds
// of the way to Catmull-Rom's, at a fraction of the cost.
inline constexpr double kSharpening = 0.3;

// The part of the image in `rect` (inside it; x0, y0 even in kI420) into the same place of `out`, which becomes an image
// of the same family and size; the rest of it is left as it is. RGB in any layout becomes packed RGB.
void sharpen(const ImageView& image, const Rect& rect, Image& out);

}  // namespace lf
