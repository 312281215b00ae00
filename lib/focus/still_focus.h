// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <optional>

#include "base/worker_pool.h"
#include "depth/array_depth.h"
#include "focus/depth_estimator.h"
#include "focus/exposure_compensation.h"
#include "rig/mesh.h"
#include "rig/still_image_cache.h"

namespace lf {

// Rounds until a focal surface has settled, starting from the viewer's plane.
inline constexpr int kSettledRounds = 12;
// Rounds until the brightness of the cameras on the surface matches, too.
inline constexpr int kMatchedRounds = 24;

// Smallest disparity between cameras that contribute to the same pixel, over the depths of the scene, with which their
// own depths give better pictures than the search, in pixels of the camera images. Measured (docs/quality.md): with 10
// pixels, the search is better by 1 to 2 dB; with 25, both are equal; from 35 on, the depths are better by 1.4 to 6 dB.
inline constexpr double kWideDisparity = 30;

// Depths are estimated up to this multiple of FocusArray::nearest(), where neighbours share five eighths of their
// images.
inline constexpr double kNearestDepth = 1.5;

// Estimates the depths of `cameras` (ascending) for focus_still(), within the limits of the settings. Returns nothing
// if they would not help: the cameras are close together (see kWideDisparity), there are fewer than two, or the focus
// is a plane. Cameras whose image cannot be read do not contribute. This takes about a second per camera; see
// ArrayDepth.
std::optional<ArrayDepth> estimate_depths(const Rig& rig, const CameraSet& cameras, const CameraImages& images,
                                          const DepthEstimator::Settings& settings,
                                          const ParallelFor& parallel = serial_for);

// Returns the view with the focal surface that `rounds` rounds of hypotheses find for a static scene: the work of nodes
// and compositor in one call. Fetches `images` of contributing cameras, which must have the rig's sizes. The view must
// be valid. `gains`: receives the exposure gains for the view's images, from the same matching as on nodes; null: no
// matching.
//
// With `depths`, the surface is the one that the cameras' own depths give, unless the cameras agree worse about it than
// about the viewer's plane. Views of hand-held and other wide arrays gain 1 to 6 dB over
// the search (docs/quality.md).
View focus_still(const Rig& rig, const Mesh& mesh, const View& view, const CameraImages& images,
                 const DepthEstimator::Settings& settings, int rounds = kSettledRounds,
                 ExposureCompensation* gains = nullptr, const ArrayDepth* depths = nullptr);

}  // namespace lf
