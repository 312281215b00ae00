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

// Number of rounds of hypotheses until a focal surface has settled, starting from the viewer's plane.
inline constexpr int kSettledRounds = 12;
// Number of rounds until the exposure gains have settled, too.
inline constexpr int kMatchedRounds = 24;

// Depths are estimated up to this multiple of the inverse distance FocusArray::nearest(). Neighbouring cameras share
// five eighths of their images there.
inline constexpr double kNearestDepth = 1.5;

// Estimates a depth map for each of `cameras` (ascending), for focus_still(), within the limits of the settings. Takes
// about a second per camera; see ArrayDepth. Returns nothing if depth maps would not help: the cameras are close
// together (see kWideDisparity), there are fewer than two, or the focus is a plane. Cameras whose image cannot be read
// do not contribute.
std::optional<ArrayDepth> estimate_depths(const Rig& rig, const CameraSet& cameras, const CameraImages& images,
                                          const DepthEstimator::Settings& settings,
                                          const ParallelFor& parallel = serial_for);

// Finds the focal surface of a view of a static scene, and returns the view with this surface. One call does the work
// of the nodes and of the compositor, for `rounds` rounds of hypotheses. It fetches `images` of contributing cameras,
// which must have the sizes in the rig. The view must be valid. `gains`, if not null, receives the exposure gains for
// the view's images, computed as on nodes.
//
// If `depths` is not null, the surface comes from the depth maps of the cameras, unless the cameras agree better
// through the viewer's plane. Compared with the search, this improves views of hand-held and other wide arrays by 1 to
// 6 dB (docs/quality.md).
View focus_still(const Rig& rig, const Mesh& mesh, const View& view, const CameraImages& images,
                 const DepthEstimator::Settings& settings, int rounds = kSettledRounds,
                 ExposureCompensation* gains = nullptr, const ArrayDepth* depths = nullptr);

}  // namespace lf
