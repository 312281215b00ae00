// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstdint>
#include <vector>

#include "render/gl/image_atlas.h"
#include "render/gl/objects.h"
#include "render/simd/band_data.h"

namespace lf::gl {

// What pixels look up of a view, whichever shaders compute them: the focal map's levels, lines of sight of distorted
// views, and the cameras' images. All calls while the context is current.
class ViewTextures {
 public:
  // Sends and binds what the sum of a task in `rect` needs. `atlas` is filled with its images, and stays until the sum
  // has been read.
  void upload(const simd::SumTask& task, const Rect& rect, ImageAtlas& atlas);
  // Tells a program in use where it all is.
  void describe(const Program& program, const simd::SumTask& task, const Rect& rect) const;

  // What was uploaded last.
  const ImageAtlas& atlas() const { return *atlas_; }

 private:
  void upload_rays(const Rays& rays, const Rect& rect, bool centres);

  const ImageAtlas* atlas_ = nullptr;
  SentTexture levels_;
  Texture rays_, centre_rays_;
  std::vector<float> ray_memory_;
};

}  // namespace lf::gl
