// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <GLES3/gl31.h>

#include <cstddef>
#include <string>

#include "base/rect.h"
#include "image/image.h"
#include "render/gl/objects.h"

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

}  // namespace lf::gl
