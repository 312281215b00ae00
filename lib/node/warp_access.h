// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include "node/camera_access.h"

namespace lf {

// Cameras that know their lens alone: each is told triangles, and the matrix of the focal plane, and gives its part of
// the sum.
const CameraAccess& warp_access();

}  // namespace lf
