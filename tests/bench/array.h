// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include "rig/rig.h"
#include "view/view.h"

namespace lf::bench {

// An array in front of the built-in scene, as mounted by hand: a grid whose cameras are off by up to 5 % of their
// distance, 1 degree and 2 % of focal length, each another way; with a lens of k1 = -0.15, k2 = 0.03 or without
// distortion. All arrays are of about one extent, however many cameras share it, and the views below are the same for
// all: what changes with the number of cameras is the size of their fragments alone.
struct ArrayOptions {
  int cameras = 64;  // rows x columns, as near to a square as they divide
  int width = 320, height = 240;
  bool distortion = true;
};
Rig make_array(const ArrayOptions& options);

// The n-th of the views of such an array: of the size of a camera's image, from a little in front of the array's
// middle, such that its lines of sight meet the whole of the array and no more. Every camera has a part in every
// pixel's neighbourhood: fragments total some 4.2 times the view, and three cover each pixel.
View make_view(int width, int height, int n = 0);

}  // namespace lf::bench
