// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include "image/image.h"
#include "reference/float_still.h"

namespace lf {

// How near a rendered picture is to what exact arithmetic makes of the same camera images: the error of a renderer and
// a codec alone, in the samples of the picture's own family.
struct ExactQuality {
  double max_error = 0;  // 0..255; rounding the exact picture to 8 bits alone costs up to 0.5
  double psnr_db = 0;    // over all samples counted: three planes, as large as they are
  double coverage = 0;   // fraction of pixels counted
};

// Of one family and size (else Error). Counted are pixels with coverage above kCovered, and chroma samples with four of
// them. If none is covered the figures are NaN.
ExactQuality compare(const Image& picture, const FloatStill& exact);

}  // namespace lf
