// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <vector>

#include "image/image.h"
#include "rig/rig.h"
#include "rig/still_image_cache.h"

namespace lf {

// Options of an epipolar-plane image (Bolles, Baker and Marimont 1987), which shows the poses of a line of cameras at a
// glance. The cameras look at one straight line in the world, parallel to the line of cameras. Each row of the image is
// a position on the line of cameras, from first to last, and comes from the nearest camera. Each column is a point on
// the line in the world. A point at `distance` is a vertical line; nearer and farther points lean to opposite sides.
struct EpipolarOptions {
  double distance = 0;  // metres from the cameras to the line in the world, along the cameras' mean axis
  double across = 0;    // offset of that line in metres: down for cameras in a row, to the right for a column
  int width = 0;        // columns; a column has the size of a pixel of the middle camera at `distance`
  int height = 0;       // rows, for all cameras together
};

// `line` contains at least two cameras of the rig, in order. `images` is called once for each camera. Pixels that a
// camera does not see are black. Throws Error if the images are not RGB of the rig's sizes, or if all cameras have the
// same position or look along their line. Also throws Error for options out of range ("distance: ...", "width: ...").
Image epipolar_image(const Rig& rig, const std::vector<CameraIndex>& line, const CameraImages& images,
                     const EpipolarOptions& options);

// Return the cameras of row or column `index` (from 0) of a grid, from the left or from the top. Throw Error if the rig
// is not a grid or has no such row or column.
std::vector<CameraIndex> row_of_cameras(const Rig& rig, int index);
std::vector<CameraIndex> column_of_cameras(const Rig& rig, int index);

}  // namespace lf
