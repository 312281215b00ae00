// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <span>
#include <vector>

#include "view/view.h"

namespace lf {

// The depths of the surface that a view shows: distances along its optical axis, in metres (the z of points in
// coordinates of the view), row by row. 0 means that the depth is unknown, and infinity is a valid depth.
struct DepthImage {
  int width = 0, height = 0;
  std::vector<float> depths;
};

// Returns the depths of the view's focal surface. The depth of a pixel is unknown if the surface is behind the view or
// parallel to the line of sight, if the lens has no line of sight there, or if its coverage is 0. `coverage` has one
// value per pixel, or is empty.
DepthImage depth_image(const View& view, std::span<const float> coverage = {});
// Returns the depth at any position of the view, in pixels.
float depth_at(const View& view, const Vec2& at);

}  // namespace lf
