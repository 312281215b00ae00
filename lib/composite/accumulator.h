// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "image/image.h"
#include "render/fragment.h"
#include "render/ownership.h"

namespace lf {

// Opaque colour shown where nothing contributes, RGB 0..255.
struct Background {
  uint8_t r = 0, g = 0, b = 0;
  bool operator==(const Background&) const = default;
};

// The compositor's arithmetic: image = sum of fragments, divided by 1 - (sum of lost weight) where weight was lost.
// Saturating 16-bit sums: up to 128 whole fragments may overlap in a pixel before the order of adding matters.
class Accumulator {
 public:
  // Clears everything. Keeps its memory.
  void reset(PixelFamily family, int width, int height);

  PixelFamily family() const { return family_; }
  int width() const { return width_; }
  int height() const { return height_; }

  // False (and nothing added) if the family differs, the rectangle is not inside the picture, or sizes don't match.
  bool add(const Fragment& fragment);
  // The hat of a camera whose fragment never came counts as lost: `hat` as from camera_hat() over `rect`.
  bool add_lost_hat(const Rect& rect, const std::vector<float>& hat);
  // Pixels that no face of the mesh owns show the background too (without it they stay as they are: black).
  void set_uncovered(const OwnerMap& whole_view);

  // The finished picture into packed planes as in ImageView: kRgb in `layout` (a fourth byte is set to 255: opaque), or
  // kI420 with the 128 offset. Rounded to the nearest level, halves up. Chroma loses the mean of the lost weight of its
  // up to four pixels; the background takes the share of those of them that show it.
  // A pixel with less than 3/255 of its weight left shows the background: rounding leaves it no colour.
  void resolve(const Background& background, const RgbLayout& layout, uint8_t* const plane[3],
               const ptrdiff_t stride[3]) const;
  Image resolve(const Background& background = {}) const;

  // The sum of what was added so far, over the bounding rectangle of it all, saturated to 8 bits; nothing if nothing
  // was added.
  std::optional<Fragment> partial_sum() const;

 private:
  // The factors for the sums of row y, 0 where the background shows; false if the row is its sum as it is.
  bool row_scales(int y, float* scale) const;
  void resolve_rgb(const Background& background, const RgbLayout& layout, uint8_t* plane, ptrdiff_t stride) const;
  void resolve_i420(const Background& background, uint8_t* const plane[3], const ptrdiff_t stride[3]) const;

  PixelFamily family_ = PixelFamily::kNone;
  int width_ = 0, height_ = 0;
  Rect touched_;  // union of what was added
  bool any_lost_ = false;
  std::vector<int16_t> sum_;        // kRgb: 3 per pixel; kI420: planes, chroma signed
  std::vector<uint16_t> lost_;      // per pixel, 255 = weight 1
  std::vector<uint8_t> uncovered_;  // per pixel, empty: unknown
};

}  // namespace lf
