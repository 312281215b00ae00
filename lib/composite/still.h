// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <vector>

#include "composite/accumulator.h"
#include "depth/array_depth.h"
#include "image/image.h"
#include "render/sum_renderer.h"
#include "rig/mesh.h"
#include "rig/still_image_cache.h"
#include "view/view.h"

namespace lf {

// Renders a view of a static array directly from its image files, without a stream. The picture is bit-identical to the
// picture of a pipeline.

struct Still {
  Image picture;                // in the family of the images, or RGB if no camera contributes
  std::vector<float> coverage;  // per pixel, 0 to 1: share of the weight that cameras could deliver
  std::vector<CameraIndex> cameras;
  GpuStatus drawing;  // how the last camera was rendered
};

// Renders a valid view of an array of still images. `mesh` is the mesh of `rig`. `images` is called once for each
// contributing camera; all images must have the same family, otherwise Error is thrown.
//
// With `resampling` kSharpened, images are sharpened if the view shows detail that bilinear sampling loses (see
// render/camera_projection.h). If the cameras have measured the view's surface (see FocalMap::measured), `depths` tell
// which cameras see it; may be null. `gpu` is the GPU renderer to use (see SumRenderer); null means the CPU.
Still render_still(const Rig& rig, const Mesh& mesh, const View& view, const CameraImages& images,
                   Resampling resampling = Resampling::kBilinear, const Background& background = {},
                   gl::GlesRenderer* gpu = nullptr, const ArrayDepth* depths = nullptr);

}  // namespace lf
