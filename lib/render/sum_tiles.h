// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include "base/rect.h"
#include "image/image.h"
#include "render/owner_runs.h"
#include "render/view_plan.h"

namespace lf {

// Rectangles of the view that together hold every pixel in which one of `cameras` (ascending) has a weight: what the
// sum of these cameras has to consist of. They are disjoint, ascend by their upper edges, and are chroma-aligned in
// kI420. `runs` cover the cameras' chroma-aligned rectangles.
//
// A rectangle is grown by what lies next to it as long as that adds at most `spare_pixels` pixels without any weight:
// as many as are cheaper to send than another rectangle. One camera's part of a view is a hexagon or so: of few spare
// pixels become rectangles of kTileRows rows, each as wide as the hexagon is there, and of many its bounds.
std::vector<Rect> sum_tiles(const ViewPlan& plan, const OwnerRuns& runs, std::span<const CameraIndex> cameras,
                            PixelFamily family, size_t spare_pixels);

// Rows that rectangles begin and end with, but for the first and the last: whole units of a JPEG.
inline constexpr int kTileRows = 16;

}  // namespace lf
