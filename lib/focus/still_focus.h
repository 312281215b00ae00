// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <memory>
#include <optional>
#include <span>

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

// Estimates depth maps for focus_still(), within the limits of the settings: of those of `cameras` (ascending) that are
// around the eyes of the views or contribute to the views. Takes 0.2 s per camera of 320x240 pixels and about a second
// per camera of 1008x756 pixels, in one thread; see ArrayDepth. Returns nothing if there are fewer than two cameras, or
// the focus is a plane. Cameras whose image cannot be read do not contribute.
std::optional<ArrayDepth> estimate_depths(const Rig& rig, const CameraSet& cameras, std::span<const View> views,
                                          const CameraImages& images, const DepthEstimator::Settings& settings,
                                          const ParallelFor& parallel = serial_for);

// Finds the focal surface of a view of a static scene, and returns the view with this surface. One call does the work
// of the nodes and of the compositor, for `rounds` rounds of hypotheses. It fetches `images` of contributing cameras,
// which must have the sizes in the rig. The view must be valid. `gains`, if not null, receives the exposure gains for
// the view's images, computed as on nodes.
//
// If `depths` is not null, the surface comes from the depth maps of the cameras, unless the cameras agree better
// through the viewer's plane. Views with the default blending then blend the ArrayDepth::kCameras nearest cameras,
// because the depth maps tell which of them see a place. Compared with the search, this improves most views by 1 to
// 9 dB (docs/quality.md).
//
// `confidence`, if not null, receives the confidence of the surface as a map: see DepthConfidence::map(). Null if the
// view shows a plane.
View focus_still(const Rig& rig, const Mesh& mesh, const View& view, const CameraImages& images,
                 const DepthEstimator::Settings& settings, int rounds = kSettledRounds,
                 ExposureCompensation* gains = nullptr, const ArrayDepth* depths = nullptr,
                 std::shared_ptr<const FocalMap>* confidence = nullptr);

}  // namespace lf
