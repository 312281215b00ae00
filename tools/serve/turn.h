// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cmath>
#include <cstdint>

namespace lf::serve {

// The part of the time between two pictures, 0 to 1, that has passed when a viewer's requests leave. Those of viewers
// that came one after the other are far apart, however many they are (multiples of the golden ratio: any n of them in a
// row are at least 1 / (1 + sqrt 5) / n apart): all at the same instant, each would wait for the others' pictures.
inline double turn_of(uint32_t view) {
  constexpr double kGoldenRatio = 0.6180339887498949;
  const double turns = kGoldenRatio * view;
  return turns - std::floor(turns);
}

}  // namespace lf::serve
