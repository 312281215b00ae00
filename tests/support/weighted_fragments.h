// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <vector>

#include "render/sum_planes.h"

namespace lf {

// What nodes send for a view of `width` x `height` of the built-in scene: the array of side x side cameras fills the
// view, so that a fragment is about 2 width / side x 2 height / side pixels. `count` of them (at most side * side),
// cameras around the middle of the array, in the order of their indices.
std::vector<Fragment> weighted_fragments(PixelFamily family, int side, int width, int height, int count);

}  // namespace lf
