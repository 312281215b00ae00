// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <vector>

#include "scene/scene.h"

namespace lf {

// A chart of 24 colours (image/colour_checker.h) that is held before an array, in front of a grey wall, for cameras'
// colours to be compared on it.
struct ChartPose {
  Pose world_from_chart;  // the chart's middle; x to its right, y down, z away from who reads it
  double width = 0.3;     // metres that the chart's black border is wide
};

// `count` places to hold the chart at: over the image of the camera in the middle from place to place, so that all
// cameras see the chart near their middle and at their edges, turned a little, and about half as wide as that image.
std::vector<ChartPose> chart_poses(const Rig& rig, int count);

// What a camera without faults records: light averaged over each pixel, encoded as render_scene() does. Rays that the
// lens does not see are black.
Image render_chart(const SceneCamera& camera, const ChartPose& chart);

}  // namespace lf
