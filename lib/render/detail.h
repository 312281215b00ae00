// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include "rig/rig.h"
#include "view/view.h"

namespace lf {

// Whether a view shows what bilinear samples of a camera's image lose, so that sharpening (image/sharpen.h) helps.

// Not where the view is so much coarser than the image that sharpened samples alias: from 0.75 of the camera's focal
// length down, pictures of the built-in scene are better without.
inline bool is_coarse(const Lens& view, const Lens& camera) { return view.fy() < 0.75 * camera.fy(); }

// Nor where the view is from the camera's own place, pixel for pixel: the samples are the pixels, and nothing is lost.
bool is_pixel_for_pixel(const View& view, const Camera& camera);

inline bool shows_detail(const View& view, const Camera& camera) {
  return !is_coarse(view.lens, camera.lens) && !is_pixel_for_pixel(view, camera);
}

}  // namespace lf
