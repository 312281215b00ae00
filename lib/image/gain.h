// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstdint>
#include <span>

#include "base/byte_buffer.h"
#include "base/rect.h"
#include "image/image.h"

namespace lf {

// Gains of cameras: 1/2 to 2. Less far from 1 than this they are not worth a pass over an image: a quarter of a level.
inline constexpr float kLeastGain = 1.f / 512;

// Takes a camera's gain out: every colour divided by it, rounded and clamped. The image with its part in `rect` (inside
// it; x0, y0 even in kI420) divided, in `memory`, of which the rest is left as it is: of the same size and layout, what
// is between the colours of a pixel divided, too. Valid as long as `memory` is left alone. The same result with every
// instruction set.
ImageView divide_by_gain(const ImageView& image, const Rect& rect, float gain, ByteBuffer& memory);
// The same of luma, in place.
void divide_by_gain(std::span<uint8_t> luma, float gain);

}  // namespace lf
