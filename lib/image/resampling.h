// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

namespace lf {

// How cameras' images are sampled.
enum class Resampling {
  kBilinear,
  kSharpened,   // bilinear, of images that were sharpened (image/sharpen.h)
  kCatmullRom,  // cubic (Keys 1981, a = -1/2) through the 4 x 4 samples around, clamped to 0..255
};

}  // namespace lf
