// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <optional>

#include "rig/still_image_cache.h"
#include "view/view_path.h"

namespace lf {

// Estimates the nearest and farthest distance with something to focus on, for a first view of an unknown rig. The
// method is a plane sweep over textured blocks of the middle camera's image, with a few of its neighbours (Collins
// 1996, "A space-sweep approach to true multi-image matching"). The estimate is rough: a tenth of the blocks is nearer,
// and a tenth is farther. Distances are along the middle camera's axis. Returns nothing if all cameras have the same
// position or the images have too little texture. `images` is called for up to five cameras.
std::optional<FocusRange> estimate_focus_range(const Rig& rig, const CameraImages& images);

}  // namespace lf
