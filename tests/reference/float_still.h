// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <vector>

#include "image/image.h"
#include "render/ownership.h"
#include "rig/rig.h"
#include "rig/still_images.h"

namespace lf {

// A view without any rounding to 8 bits on its way: what fast renderers and codecs are measured against. It is within
// 2e-3 of 255 of the rule in 80-bit reals (tests/reference), for I420 images as they are.
struct FloatStill {
  PixelFamily family = PixelFamily::kNone;
  int width = 0, height = 0;
  std::vector<double> colour;  // 0..255, laid out as Image::data(), after the division by 1 - lost; chroma with its 128
  std::vector<double> valid, lost;  // sums of weights per pixel, row-major

  std::vector<float> coverage() const { return {valid.begin(), valid.end()}; }
};

// Asks `images` only for cameras that contribute; all must be of `family` (else Error).
// `owners.region()` is the whole view.
FloatStill render_float_still(const Rig& rig, const ViewPlan& plan, const OwnerMap& owners, PixelFamily family,
                              const CameraImages& images);

}  // namespace lf
