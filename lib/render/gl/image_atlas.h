// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <span>
#include <string>
#include <vector>

#include <GLES3/gl31.h>

#include "base/maths.h"
#include "base/worker_pool.h"
#include "image/image.h"
#include "render/gl/objects.h"
#include "render/simd/sum_task.h"
#include "render/sum_renderer.h"

namespace lf::gl {

// Copies parts of images that are on the card into the bytes that a pass's texture is made from: divided and sharpened
// as their CardPixels say, to the bit as the CPU does it. A compute shader does, as some cards have fragment shaders on
// a few of their processors only, and Mesa's llvmpipe may crash where one context draws triangles while another writes
// a texture. All calls while the context is current.
class CardPieces {
 public:
  // Samples that a compute shader writes at once: pieces of planes of one byte a pixel begin at whole words.
  static constexpr int kWord = 4;

  CardPieces() = default;
  ~CardPieces();
  CardPieces(const CardPieces&) = delete;
  CardPieces& operator=(const CardPieces&) = delete;

  // What follows goes to so many bytes; until end(). False with the reason in `why` if that can't be done.
  bool begin(size_t bytes, Programs& programs, std::string& why);
  // The buffer of them.
  GLuint name() const { return bytes_.name(); }
  // `part`, whose pixels may be followed by up to a word of others, of a plane of an image of width x height pixels.
  struct Plane {
    int index, width, height;
    Rect part;
    size_t first;  // the word where the part's first pixel goes
    int row;       // words from there to the row below
  };
  void copy(const ImageView& image, const Plane& plane);
  void end();

 private:
  GLuint nearest_ = 0;
  Buffer bytes_{Buffer::Use::kComputed};
  const Program* program_ = nullptr;
};

// One of the views that are drawn in a pass.
struct DrawnView {
  const simd::SumTask* task = nullptr;
  std::span<const Source> sources;  // what the task was made of
  Rect rect;                        // what is drawn of the view
};

// What is needed of cameras' images: which part of one, and whether its colours.
struct NeededPixels {
  std::function<Rect(const DrawnView&, const Source&)> part;
  bool colours = true;
};

// What the views of a pass need of cameras' images, side by side in one texture, which is a few times as large as a
// view, however many and however large the images are, where the mesh blends; else as many times as cameras see it. It
// is sent in one piece: cards are slow with many small ones. An image that several views look at is there once, with
// all that they need of it. What is needed of images that are on the card, in textures that the context shares, is
// copied there.
//
// Calls need no context but where they say so: what takes long, filling it, is done while the card draws something
// else.
//
// Samples are bytes. In kI420 luma's pieces are above; below are Cb's and, to their right, Cr's, in the same order at
// half the size, if colours are needed.
class ImageAtlas {
 public:
  static constexpr size_t kMostBytes = 512'000'000;

  // Gives each of the views' sources that has an image and a slot in its task a place, in a texture of at most
  // `max_size` pixels a side and kMostBytes; false if they don't fit. All images are of one family, and stay where they
  // are until they are uploaded.
  bool lay_out(std::span<const DrawnView> views, const NeededPixels& needed, int max_size);

  // Where pixel (0, 0) of an image would be; even.
  struct Offset {
    int x = 0, y = 0;
  };
  // Of the images of a view's slots.
  std::span<const Offset> offsets(size_t view) const { return offsets_[view]; }
  // kI420: where Cb (1) and Cr (2) of what is at (0, 0) are.
  Offset chroma_offset(int plane) const { return {plane == 1 ? 0 : width_ / 2, height_}; }

  // Whether there is memory for what was laid out, and makes room for it, while the context is current.
  bool has_room() const { return texture_.has_room(sent_size()); }
  void reserve() { texture_.reserve(sent_size()); }
  // Copies what was laid out to where the card can reach it, after what was drawn from it before has been read.
  void fill(const ParallelFor& parallel);
  // Sends it, has `pieces` copy what is on the card, and binds it. While the context is current. False with the reason
  // in `why` if that can't be done.
  bool send(CardPieces& pieces, Programs& programs, std::string& why);

 private:
  struct Piece {
    const ImageView* image;
    Rect part;  // of it
    Offset at;
  };
  struct Use {
    size_t view, slot, piece;
  };
  void find_pieces(std::span<const DrawnView> views, const NeededPixels& needed);
  int place_pieces();
  void copy(const Piece& piece, uint8_t* to) const;
  void copy_there(const Piece& piece, CardPieces& pieces) const;
  int all_rows() const { return has_chroma_ ? height_ + height_ / 2 : height_; }
  size_t size() const { return static_cast<size_t>(width_) * all_rows() * static_cast<size_t>(bytes_); }
  // A view that no camera shows anything of is sent a texture of nothing.
  size_t sent_size() const { return has_sent_ || !has_card_ ? size() : 0; }

  std::vector<Piece> pieces_;
  std::vector<Use> uses_;
  std::vector<std::vector<Offset>> offsets_;  // by view and slot
  int width_ = 0, height_ = 0;                // of what is RGB or luma
  int bytes_ = 1;                             // a pixel
  bool has_chroma_ = false;
  bool has_sent_ = false, has_card_ = false;  // images that come from here, and that are on the card
  SentTexture texture_;
};

}  // namespace lf::gl
