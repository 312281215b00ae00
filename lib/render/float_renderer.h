// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <optional>
#include <vector>

#include "image/image.h"
#include "image/resampling.h"
#include "render/ownership.h"
#include "rig/rig.h"

namespace lf {

// For tests and measurements: the scalar renderer's fragment without its rounding to 8 bits.
struct FloatFragment {
  PixelFamily family = PixelFamily::kNone;
  Rect rect;                       // chroma-aligned for kI420
  std::vector<float> colour;       // 0..255, weighted, laid out as Fragment::pixels; chroma without the 128 offset
  std::vector<float> valid, lost;  // weights 0..1 per pixel of `rect`, row-major
};

// Arguments as for FragmentRenderer::render().
std::optional<FloatFragment> render_float(const ViewPlan& plan, const OwnerMap& owners, CameraIndex camera,
                                          const Camera& rig_camera, const ImageView& image,
                                          Resampling resampling = Resampling::kBilinear);

}  // namespace lf
