// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstdint>
#include <vector>

#include "base/rect.h"

namespace lf {

// Rectangles of which no two meet. Of a few each is looked at; of many a bit for each pixel tells, so that what one
// more costs does not depend on how many there are, and never more than a 64th of adding up its pixels. Not
// thread-safe.
class DisjointRects {
 public:
  static constexpr size_t kFew = 32;

  // Whether one of the rectangles has a pixel in `rect`, whose x0 and y0 are at least 0.
  bool meets(const Rect& rect) const;
  // Adds a rectangle; false, and nothing is noted, if it meets another one.
  bool add(const Rect& rect);
  const std::vector<Rect>& rects() const { return rects_; }

 private:
  void mark(const Rect& rect);

  std::vector<Rect> rects_;
  // A bit for each pixel, rows as long as they have to be; used with more than kFew rectangles.
  std::vector<std::vector<uint64_t>> rows_;
};

}  // namespace lf
