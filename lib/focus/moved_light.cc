// SPDX-License-Identifier: LGPL-2.1-or-later
#include "focus/moved_light.h"

namespace lf {

double moved_light(std::span<const Moments> trials, std::span<const uint8_t> chosen, size_t plane) {
  constexpr int kAllWeight = Moments::kWeightOne * 15 / 16;
  constexpr double kLuma = static_cast<double>(Moments::kWeightOne) / Moments::kLumaOne;
  constexpr int kLeastNodes = 100;  // what stands at the border of fewer is too much of them
  const Moments& through = trials[plane];
  double moved[4] = {};
  int nodes[4] = {};
  size_t i = 0;
  for (int y = 0; y < through.rows; y++)
    for (int x = 0; x < through.columns; x++, i++) {
      const Moments& surface = trials[chosen[i]];
      if (surface.weight[i] < kAllWeight || through.weight[i] < kAllWeight) continue;
      const int quarter = 2 * (2 * y / through.rows) + 2 * x / through.columns;
      moved[quarter] += kLuma * (static_cast<double>(surface.luma[i]) / surface.weight[i] -
                                 static_cast<double>(through.luma[i]) / through.weight[i]);
      nodes[quarter]++;
    }
  double squares = 0;
  int all = 0;
  for (int q = 0; q < 4; q++) {
    if (nodes[q] < kLeastNodes) continue;
    squares += moved[q] * moved[q] / nodes[q];
    all += nodes[q];
  }
  return all > 0 ? squares / all : 0;
}

}  // namespace lf
