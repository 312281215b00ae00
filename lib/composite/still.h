// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <vector>

#include "composite/accumulator.h"
#include "image/image.h"
#include "render/sum_renderer.h"
#include "rig/mesh.h"
#include "rig/still_image_cache.h"
#include "view/view.h"

namespace lf {

// Renders a view of a static array directly from its images, without a stream. The picture is bit-identical to the
// output of a pipeline.

struct Still {
  Image picture;                     // family of the images; RGB if no camera contributes
  std::vector<float> coverage;       // per pixel, 0..1: share of the weight that cameras could deliver
  std::vector<CameraIndex> cameras;  // ascending
  GpuStatus drawing;                 // status of the last camera
};

// Loads each contributing camera's image once. Throws Error unless all images have the same family. `mesh`: the mesh of
// `rig`. The view must be valid. `resampling`: kSharpened sharpens images if the view shows detail that bilinear
// sampling loses (render/camera_projection.h). `gpu`: draws the sums, see SumRenderer; null: CPU.
Still render_still(const Rig& rig, const Mesh& mesh, const View& view, const CameraImages& images,
                   Resampling resampling = Resampling::kBilinear, const Background& background = {},
                   gl::GlesRenderer* gpu = nullptr);

}  // namespace lf
