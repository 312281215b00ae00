// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstddef>
#include <cstdint>

#include "image/image.h"
#include "render/sum_planes.h"

namespace lf {

// After resolve(), where most of a pixel's weight was lost: what little is left has been scaled up with all its noise,
// and with nothing left the background shows. The view's picture before this one is nearer to the truth there: with an
// eighth of the weight or less left a pixel is that one's, with a quarter or more it stays as it is, between them it
// is a mixture.
//
// `sum`: as resolve() took it. `before`: of the same family, size and layout as the picture in `plane`, `stride`.
void conceal(const ConstSumPlanes& sum, const ImageView& before, uint8_t* const plane[3], const ptrdiff_t stride[3]);

}  // namespace lf
