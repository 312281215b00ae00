// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <algorithm>
#include <vector>

#include "base/rect.h"

namespace lf::wire {

// A sum that is to be encoded is cut into fragments of about so many pixels: coding and decoding them takes several
// threads, and a lost packet loses a strip and not the view.
inline constexpr int kStripPixels = 1 << 16, kStripUnit = 16;

// Rows of strips of at most `pixels` pixels, but for kStripUnit rows being the least.
inline int strip_rows(int width, int pixels = kStripPixels) {
  return std::max(pixels / width / kStripUnit, 1) * kStripUnit;
}

// Rectangles of all of `rect`'s width and at most `rows` rows.
inline std::vector<Rect> cut_rows(const Rect& rect, int rows) {
  std::vector<Rect> parts;
  for (int y = rect.y0; y < rect.y1; y += rows) parts.push_back({rect.x0, y, rect.x1, std::min(y + rows, rect.y1)});
  return parts;
}

}  // namespace lf::wire
