// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <string>
#include <vector>

#include "image/image.h"
#include "view/depth_image.h"
#include "view/view.h"

namespace lf {

// A point of the surface that a view shows, in world coordinates (metres), with its colour.
struct ColouredPoint {
  float x, y, z;
  uint8_t red, green, blue;
};

// Returns the points of all pixels with a known and finite depth, row by row. Pixels beside a depth edge, where the
// depth changes by more than a twentieth from one pixel to the next, are left out, because they are between two
// surfaces. `rgb` must have the size and the family (kRgb) of the view's picture.
std::vector<ColouredPoint> point_cloud(const View& view, const DepthImage& depths, const ImageView& rgb);

// Writes a PLY file (Stanford Triangle Format 1.0, binary, little-endian) with x, y, z, red, green and blue of each
// vertex. Throws Error with the file's name.
void save_ply(const std::vector<ColouredPoint>& points, const std::string& path);

}  // namespace lf
