// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <utility>
#include <vector>

#include "render/sum_planes.h"

namespace lf::test {

// The upper half of a fragment in RGB, and the lower one.
inline std::vector<Fragment> halves_of(const Fragment& whole) {
  std::vector<Fragment> halves;
  const int width = whole.rect.width(), middle = (whole.rect.y0 + whole.rect.y1) / 2;
  for (const auto& [y0, y1] : {std::pair{whole.rect.y0, middle}, {middle, whole.rect.y1}}) {
    const auto first = static_cast<ptrdiff_t>(y0 - whole.rect.y0) * width;
    const auto past = static_cast<ptrdiff_t>(y1 - whole.rect.y0) * width;
    Fragment half{whole.family, {whole.rect.x0, y0, whole.rect.x1, y1}, {}, {}};
    half.pixels.assign(whole.pixels.begin() + 3 * first, whole.pixels.begin() + 3 * past);
    if (!whole.lost.empty()) half.lost.assign(whole.lost.begin() + first, whole.lost.begin() + past);
    halves.push_back(std::move(half));
  }
  return halves;
}

}  // namespace lf::test
