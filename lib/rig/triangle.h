// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <array>

#include "rig/rig.h"

namespace lf {

// Three cameras by index; the order says which way the triangle turns.
using Triangle = std::array<CameraIndex, 3>;

// The same triangle, turning the same way, beginning at its lowest index.
inline Triangle lowest_first(const Triangle& t) {
  if (t[1] < t[0] && t[1] <= t[2]) return {t[1], t[2], t[0]};
  if (t[2] < t[0] && t[2] < t[1]) return {t[2], t[0], t[1]};
  return t;
}

}  // namespace lf
