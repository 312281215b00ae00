// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <vector>

#include "composite/accumulator.h"
#include "image/image.h"
#include "render/sum_renderer.h"
#include "rig/mesh.h"
#include "rig/still_images.h"
#include "view/view.h"

namespace lf {

// Views of an array that stands still, rendered in one go from its images: the whole path from camera images to a
// picture without a stream in between, and the same picture to the bit.

// What one view came to.
struct Still {
  Image picture;                     // has the images' family; RGB where no camera contributes
  std::vector<float> coverage;       // per pixel, 0..1: how much of its weight cameras could give
  std::vector<CameraIndex> cameras;  // cameras that contributed, ascending
  Drawing drawing;                   // of the last camera's part
};

// Asks `images` only for cameras that contribute, each once; all must be of one family (else Error).
// `mesh`: of `rig`. The view must be valid. `resampling`: as of a node; kSharpened sharpens images of which the view
// shows what bilinear samples lose (render/camera_projection.h).
// `card`: draws the cameras' parts, see SumRenderer; null: the CPU does.
Still render_still(const Rig& rig, const Mesh& mesh, const View& view, const CameraImages& images,
                   Resampling resampling = Resampling::kBilinear, const Background& background = {},
                   gl::SumDrawer* card = nullptr);

}  // namespace lf
