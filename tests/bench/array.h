// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include "rig/rig.h"
#include "view/view.h"

namespace lf::bench {

// An array in front of the built-in scene, as mounted by hand: a grid of cameras that are off by up to 5 % of the
// pitch, 1 degree and 2 % of the focal length, with k1 = -0.15, k2 = 0.03 or without distortion. All arrays have about
// the same extent and the same views: the number of cameras changes only the size of their fragments.
struct ArrayOptions {
  int cameras = 64;  // rows x columns, as square as divisors allow
  int width = 320, height = 240;
  bool distortion = true;
};
Rig make_array(const ArrayOptions& options);

// Returns the n-th view of such an array: with the size of a camera image, from slightly in front of the array's
// centre, covering exactly the array. Every camera contributes: fragments total about 4.2 times the view, and three
// cover each pixel.
View make_view(int width, int height, int n = 0);

}  // namespace lf::bench
