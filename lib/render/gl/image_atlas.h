// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "base/rect.h"
#include "render/gl/objects.h"
#include "render/simd/band_data.h"
#include "render/sum_renderer.h"

namespace lf::gl {

// What a view needs of cameras' images, side by side in one texture (one of pixels, one of chroma), which is a few
// times as large as the view, however many and however large the images are. Calls of upload...() while the context is
// current.
class ImageAtlas {
 public:
  // Gives each of the sources that has an image and a slot in the task its place, in a texture of at most `max_size`
  // pixels a side; false if they don't fit. Sources are of the task's family, and stay where they are until they are
  // uploaded.
  bool lay_out(const simd::SumTask& task, std::span<const Source> sources, int max_size);

  // Where pixel (0, 0) of the slot's image would be; even.
  struct Offset {
    int x = 0, y = 0;
  };
  const Offset& offset(int32_t slot) const { return offsets_[static_cast<size_t>(slot)]; }

  // Sends what was laid out, and binds it: RGB or luma, and then chroma.
  void upload();
  void upload_chroma();

 private:
  struct Piece {
    const ImageView* image;
    Rect part;  // of it
    int32_t slot;
  };
  void send(const Piece& piece);

  std::vector<Piece> pieces_;
  std::vector<Offset> offsets_;  // by slot
  int width_ = 0, height_ = 0, bytes_ = 1;
  Texture pixels_, chroma_;
  std::vector<uint8_t> packed_;
  std::vector<uint16_t> packed_chroma_;
};

}  // namespace lf::gl
