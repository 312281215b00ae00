// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <vector>

#include "image/image.h"
#include "rig/rig.h"
#include "rig/still_images.h"

namespace lf {

// An epipolar-plane image (Bolles, Baker and Marimont 1987) of cameras that stand in a line: what each of them sees of
// one straight line in the world, which is parallel to theirs. Each row of the picture is a place on the line of
// cameras, from the first to the last, and shows the camera that is nearest to it; each column is a point of the line
// in the world. A point at the distance in focus is a vertical line of the picture, nearer points lean to one side and
// farther ones to the other, the more the farther they are from it.
struct EpipolarOptions {
  double distance = 0;  // metres from the line of cameras to the one in the world, along the cameras' mean axis
  double across = 0;    // metres that this one is moved by: down for cameras in a row, to the right in a column
  int width = 0;        // pixels, each as large as one of the middle camera at that distance
  int height = 0;       // pixels, all cameras together
};

// `line`: at least two cameras of the rig, in order. Asks `images` for each of them once; they must be RGB and of the
// rig's sizes (else Error). What a camera does not see is black. Throws Error for cameras that are all at one place,
// or that look along their line, and ("distance: ...", "width: ...") for options out of range.
Image epipolar_image(const Rig& rig, const std::vector<CameraIndex>& line, const CameraImages& images,
                     const EpipolarOptions& options);

// The cameras of row or column `index` (from 0) of a grid, from the left or from the top. Throws Error where the rig is
// no grid or has no such row or column.
std::vector<CameraIndex> row_of_cameras(const Rig& rig, int index);
std::vector<CameraIndex> column_of_cameras(const Rig& rig, int index);

}  // namespace lf
