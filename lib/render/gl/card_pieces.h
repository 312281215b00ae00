// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <GLES3/gl31.h>

#include <string>

#include "base/rect.h"
#include "image/image.h"
#include "render/gl/objects.h"

namespace lf::gl {

// Draws parts of images that are on the card into the texture that a pass samples them from: divided and sharpened as
// their CardPixels say, to the bit as the CPU does it. All calls while the context is current.
class CardPieces {
 public:
  CardPieces() = default;
  ~CardPieces();
  CardPieces(const CardPieces&) = delete;
  CardPieces& operator=(const CardPieces&) = delete;

  // What follows goes to this texture, of 8 bits a channel; until end(). False with the reason in `why` if that can't
  // be done.
  bool begin(GLuint texture, Programs& programs, std::string& why);
  // A plane of an image, of width x height pixels: `part` of it, so that its pixel (0, 0) would be at (x, y).
  struct Plane {
    int index, width, height;
    Rect part;
    int x, y;
  };
  void draw(const ImageView& image, const Plane& plane);
  void end();

 private:
  GLuint target_ = 0, no_vertices_ = 0, nearest_ = 0;
  const Program* program_ = nullptr;
};

}  // namespace lf::gl
