// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstdint>
#include <functional>
#include <span>
#include <vector>

#include "base/rect.h"
#include "base/worker_pool.h"
#include "render/gl/objects.h"
#include "render/simd/band_data.h"
#include "render/sum_renderer.h"

namespace lf::gl {

// What is needed of cameras' images: which part of one, and whether its colours.
struct NeededPixels {
  std::function<Rect(const Source&)> part;
  bool colours = true;
};

// What a view needs of cameras' images, side by side in one texture, which is a few times as large as the view, however
// many and however large the images are. It is sent in one piece: cards are slow with many small ones.
//
// Calls need no context but where they say so: what takes long, filling it, is done while the card draws something
// else.
//
// Samples are bytes. In kI420 luma's pieces are above; below are Cb's and, to their right, Cr's, in the same order at
// half the size, if colours are needed.
class ImageAtlas {
 public:
  // Gives each of the sources that has an image and a slot in the task its place, in a texture of at most `max_size`
  // pixels a side; false if they don't fit. Sources are of the task's family, and stay where they are until they are
  // uploaded.
  bool lay_out(const simd::SumTask& task, std::span<const Source> sources, const NeededPixels& needed, int max_size);

  // Where pixel (0, 0) of the slot's image would be; even.
  struct Offset {
    int x = 0, y = 0;
  };
  const Offset& offset(int32_t slot) const { return offsets_[static_cast<size_t>(slot)]; }
  // kI420: where Cb (1) and Cr (2) of what is at (0, 0) are.
  Offset chroma_offset(int plane) const { return {plane == 1 ? 0 : width_ / 2, height_}; }

  // Whether there is memory for what was laid out, and makes room for it, while the context is current.
  bool has_room() const { return texture_.has_room(size()); }
  void reserve() { texture_.reserve(size()); }
  // Copies what was laid out to where the card can reach it, after what was drawn from it before has been read.
  void fill(const ParallelFor& parallel);
  // Sends it, and binds it. While the context is current.
  void send();

 private:
  struct Piece {
    const ImageView* image;
    Rect part;  // of it
    int32_t slot;
  };
  void copy(const Piece& piece, uint8_t* to) const;
  int all_rows() const { return has_chroma_ ? height_ + height_ / 2 : height_; }
  size_t size() const { return static_cast<size_t>(width_) * all_rows() * static_cast<size_t>(bytes_); }

  std::vector<Piece> pieces_;
  std::vector<Offset> offsets_;  // by slot
  int width_ = 0, height_ = 0;   // of what is RGB or luma
  int bytes_ = 1;                // a pixel
  bool has_chroma_ = false;
  SentTexture texture_;
};

}  // namespace lf::gl
