// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include "base/byte_buffer.h"
#include "base/rect.h"
#include "image/image.h"

namespace lf {

// An image in textures of a graphics card, which sums are sampled from without its coming here first.
class CardImage {
 public:
  virtual ~CardImage() = default;

  struct Texture {
    unsigned name;  // OpenGL's, of a GL_TEXTURE_2D of at least the plane's size
    int channel;    // kI420: the one that has the plane's samples. kRgb: all have, one for each byte of a pixel
  };
  // Of plane 0 (kRgb), or of Y, Cb, Cr.
  virtual Texture plane(int index) const = 0;
  // To be called in a context that shares the textures, before they are read: what the context is given from then on
  // finds in them what is to be there.
  virtual void wait() const = 0;
  // The image in this process's memory, of the same family, size and layout, valid as long as this lives; kNone where
  // it can't be had. Any thread, as often as anybody wants.
  virtual ImageView fetch() const = 0;
  // Whether anybody has asked for that.
  virtual bool is_fetched() const = 0;
};

// What fetched() makes of an image.
struct FetchedMemory {
  ByteBuffer divided, sharpened;
};

// The image in this process's memory, with what its CardPixels say made of `part` of it (inside the image; x0, y0 even
// in kI420): itself if it is here; kNone where it can't be had. Valid as long as `memory` and the CardImage are left
// alone.
ImageView fetched(const ImageView& image, const Rect& part, FetchedMemory& memory);

}  // namespace lf
