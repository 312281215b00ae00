// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <optional>
#include <vector>

#include "image/image.h"
#include "render/ownership.h"
#include "rig/rig.h"

namespace lf {

// One camera's part in a view, pixel by pixel in double precision along the production plan, rounded nowhere: what the
// SIMD sums are measured against in every family and blending.
struct FloatFragment {
  PixelFamily family = PixelFamily::kNone;
  Rect rect;                       // chroma-aligned for kI420
  std::vector<float> colour;       // 0..255, weighted, laid out as Image::data(); chroma without the 128 offset
  std::vector<float> valid, lost;  // weights 0..1 per pixel of `rect`, row-major
};

// `camera` is `rig_camera`'s index in the rig of the plan, `image` of its size (else Error); `owners` cover the
// camera's rectangle, chroma-aligned for kI420. Nothing if the camera has no weight anywhere in the view.
std::optional<FloatFragment> render_float(const ViewPlan& plan, const OwnerMap& owners, CameraIndex camera,
                                          const Camera& rig_camera, const ImageView& image);

}  // namespace lf
