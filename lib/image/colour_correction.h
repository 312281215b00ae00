// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstdint>
#include <vector>

#include "base/byte_buffer.h"
#include "base/rect.h"
#include "image/colour_model.h"
#include "image/image.h"

namespace lf {

// A ColourModel made ready for one camera's images of one family. Immutable.
//
// What the model does to a colour is close to an affine function of it, which is applied to each pixel; what is left of
// it is read from a table of 32 x 32 x 32 colours, without interpolation, in I420 for 2 x 2 pixels together; and what
// the lens loses is a factor, interpolated between rows. 16-bit arithmetic, the same result with every instruction set.
// Against the model in double precision levels are off by 0.3 in the mean, of which 0.25 is rounding; 1 % of the most
// saturated and dark ones are off by more than 1, by 6 at most.
class ColourCorrection {
 public:
  // `centre`: the lens's principal point, pixels. `family`: not kNone. The model has no fault.
  ColourCorrection(const ColourModel& model, PixelFamily family, int width, int height, const Vec2& centre);

  // Whether the correction leaves every level as it is.
  bool is_identity() const { return is_identity_; }
  // The image, of the family and size that this is for, with its part in `rect` (inside it; x0, y0 even in kI420)
  // corrected, in `memory`, of which the rest is left as it is: of the same size and layout. Valid as long as `memory`
  // is left alone.
  ImageView apply(const ImageView& image, const Rect& rect, ByteBuffer& memory) const;

  // Fixed-point numbers, for the loops. Channels are R, G, B or Y, Cb, Cr without the 128 offset.
  static constexpr int kRowsApart = 8;  // rows of the table of factors, in rows of its plane
  struct Tables {
    int16_t matrix[3][3];         // 13 bits of fraction
    int16_t offset[3];            // 5 bits
    std::vector<uint32_t> rest;   // ten bits a channel from the highest, quarters of a level; empty: all 0
    std::vector<int16_t> factor;  // 14 bits; columns x rows; chroma's columns and rows in kI420
    int factor_columns = 0;
  };

 private:
  void fit(const ColourModel& model);
  void tabulate_factor(const ColourModel& model, int width, int height, const Vec2& centre);

  PixelFamily family_;
  Tables tables_;
  bool is_identity_ = false;
};

// The whole image, corrected; `centre`: the principal point of the camera's lens.
Image corrected(const Image& image, const ColourModel& model, const Vec2& centre);

}  // namespace lf
