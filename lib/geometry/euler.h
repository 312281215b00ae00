// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include "base/vec.h"

namespace lf {

// An orientation as people type it, in degrees; right-handed turns about the camera's own axes, applied yaw first:
// R = Ry(yaw) Rx(pitch) Rz(roll). With x right, y down, z forward: yaw > 0 turns right, pitch > 0 looks up, roll > 0
// turns the camera clockwise (as seen from behind it). All zero: axes along the world's.
struct Euler {
  double yaw = 0, pitch = 0, roll = 0;
};

Quat quat_from_euler(const Euler& degrees);  // unit norm
// yaw and roll in [-180, 180], pitch in [-90, 90]; straight up or down roll is 0 and yaw carries both.
// quat_from_euler() of the result is the same orientation to 1e-14 everywhere.
Euler euler_from_quat(const Quat& orientation);

}  // namespace lf
