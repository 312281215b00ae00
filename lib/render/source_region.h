// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <span>
#include <vector>

#include "base/rect.h"
#include "render/view_plan.h"
#include "rig/rig.h"

namespace lf {

// The pixels of a camera's image that its contribution to the view may be sampled from, with those that interpolation
// and chroma reach: what has to be decoded of it. `rect`: of the view, where the camera may have a weight. The whole
// image where that can't be told; empty if none of it is seen.
Rect source_region(const ViewPlan& plan, const Rect& rect, CameraIndex camera, const Camera& rig_camera);
// The same for a focal map with other levels than the view's own, from the least to the largest that there are in
// `rect`.
Rect source_region(const ViewPlan& plan, const Rect& rect, CameraIndex camera, const Camera& rig_camera,
                   const FocalMap::LevelRange& levels);

// What has to be there of a contributing camera's image for all of its part in the view: the above, grown to whole
// chroma samples; one pixel where none is seen, because the part is lost weight then.
Rect needed_pixels(const ViewPlan& plan, CameraIndex camera, const Camera& rig_camera);
// The same for focal maps with other levels than the view's own, all of them; but empty where nothing is seen.
Rect needed_pixels(const ViewPlan& plan, CameraIndex camera, const Camera& rig_camera,
                   std::span<const std::vector<uint8_t>> maps);

}  // namespace lf
