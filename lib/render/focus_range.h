// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <optional>

#include "rig/still_images.h"
#include "view/view_path.h"

namespace lf {

// How near and how far there is something to focus on, from the images of the camera in the middle of the array and a
// few around it: a plane sweep over blocks of the middle image, whose texture decides (Collins 1996, "A space-sweep
// approach to true multi-image matching"). Rough, meant for a first picture of an unknown rig: a tenth of the blocks is
// nearer and a tenth farther. Distances are along the middle camera's axis.
// Nothing if the rig has a single position or too little texture. Asks `images` for up to five cameras.
std::optional<FocusRange> estimate_focus_range(const Rig& rig, const CameraImages& images);

}  // namespace lf
