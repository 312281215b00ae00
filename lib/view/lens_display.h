// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstddef>
#include <cstdint>

#include "base/worker_pool.h"
#include "image/image.h"

namespace lf {

// A display behind a sheet of upright or slanted cylinder lenses (or slits), which show another stripe of what is
// behind them to each side: stripes of many views, one beside the other behind each lens, are a light field without
// glasses. Each pixel has a red, a green and a blue stripe, from left to right, each a third of its width.
// (C. van Berkel, Image preparation for 3D-LCD, 1999: the view of a subpixel from its place under a slanted lens.)
struct LensDisplay {
  double lens_width = 0;  // pixels along a row of the display; more than 0
  double slant = 0;       // degrees that lenses lean to the right from upright, less than 90 either way
  double centre = 0;      // lens widths that the middle of a lens is to the right of the display's middle
  bool reversed = false;  // the lenses show stripes the other way round, as where what is shown is turned about

  // The place in its lens of what is `x`, `y` (pixels, to the right and down) from the display's middle: from 0, at the
  // left border, to 1.
  double place(double x, double y) const;
};
// Throws Error ("lenses: ...") for a width that is not positive and finite, or a slant or centre out of range.
void validate(const LensDisplay& display);

// Views side by side in one picture, as many in a row and as many rows as given: from left to right, the rows from
// below, as in SetLayout::kQuilt (a row of views is one of one row).
struct Quilt {
  ImageView picture;  // of PixelFamily::kRgb, `columns` x `rows` pictures of one size
  int columns = 1, rows = 1;
  int count() const { return columns * rows; }
};

// Fills `width` x `height` pixels of RGB, 3 bytes each, rows `stride` bytes apart: each view is spread over the whole
// display (bilinear in 8 bits, within 2 of 255), and each subpixel is of the view that is seen there. What leaves a
// lens from its left part goes to the right, so that view 0, of the left-most eye, is seen at the right border of a
// lens. Rows are shared out by `parallel`.
void interleave(const LensDisplay& display, const Quilt& quilt, int width, int height, ptrdiff_t stride, uint8_t* out,
                const ParallelFor& parallel = serial_for);

}  // namespace lf
