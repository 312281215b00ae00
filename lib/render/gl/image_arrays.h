// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "render/gl/objects.h"
#include "render/simd/band_data.h"
#include "render/sum_renderer.h"

namespace lf::gl {

// Cameras' images on the card: a layer for each slot of a task. All calls while the context is current.
class ImageArrays {
 public:
  // Sends what the task's view needs of the sources' images, and binds it: RGB or luma, and then chroma.
  void upload(const simd::SumTask& task, std::span<const Source> sources);
  void upload_chroma(const simd::SumTask& task, std::span<const Source> sources);

 private:
  void send_pixels(const ImageView& image, const Rect& part, int layer, int bytes);
  void send_chroma(const ImageView& image, const Rect& part, int layer);

  Texture images_{GL_TEXTURE_2D_ARRAY}, chroma_{GL_TEXTURE_2D_ARRAY};
  std::vector<uint8_t> packed_;
  std::vector<uint16_t> packed_chroma_;
};

}  // namespace lf::gl
