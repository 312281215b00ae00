// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include "focus/focus_control.h"
#include "rig/mesh.h"
#include "rig/still_images.h"

namespace lf {

// The rounds after which a focal surface has settled, from the viewer's plane on.
inline constexpr int kSettledRounds = 12;

// The view with the focal surface that `rounds` rounds of trials find, for an array that stands still: all that nodes
// and a compositor do, in one go. Asks `images` for cameras that contribute, which must be of the rig's sizes. The view
// must be valid.
View focus_still(const Rig& rig, const Mesh& mesh, const View& view, const CameraImages& images,
                 const FocusControl::Settings& settings, int rounds = kSettledRounds);

}  // namespace lf
