// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstdint>
#include <span>

#include "focus/moments.h"

namespace lf {

// How much light a surface has lost or made up. What is out of focus is spread over its surroundings, and none of it is
// lost: through the right surface a large part of the picture is as bright as through any plane. Cameras that agree
// because all of them look past a thing show none of it, and only this tells.
//
// The squared difference of the mean luma, mean over the quarters of the picture, levels squared; of nodes that all
// weight sees both ways, in quarters with a hundred of them, and 0 without such. `chosen`: the trial of each node that
// makes up the surface. `plane`: which of the trials is the plane.
double moved_light(std::span<const Moments> trials, std::span<const uint8_t> chosen, size_t plane);

}  // namespace lf
