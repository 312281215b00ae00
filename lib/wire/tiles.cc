// SPDX-License-Identifier: LGPL-2.1-or-later
#include "wire/tiles.h"

#include <algorithm>

#include "wire/limits.h"
#include "wire/payload.h"

namespace lf::wire {
namespace {

int divided_up(int a, int b) { return (a + b - 1) / b; }

}  // namespace

Rect Tiling::tile(size_t i) const {
  const int x = whole.x0 + static_cast<int>(i % columns) * width, y = whole.y0 + static_cast<int>(i / columns) * height;
  return {x, y, std::min(x + width, whole.x1), std::min(y + height, whole.y1)};
}

FragmentHeader tile_header(const FragmentHeader& fragment, const Rect& tile) {
  FragmentHeader out = fragment;
  out.rect = tile;
  return out;
}

std::optional<Tiling> tile_raw(const FragmentHeader& fragment, size_t max_bytes) {
  if (is_jpeg(fragment.codec)) return std::nullopt;
  const int unit = fragment.family == PixelFamily::kI420 ? 2 : 1;  // pixels a side that stay together
  const auto units_that_fit = [&](int width, int height) {
    const size_t bytes = raw_size(tile_header(fragment, {0, 0, width, height}));
    return static_cast<int>(std::min<size_t>(max_bytes / bytes, kMaxViewSize / unit));
  };
  Tiling out{.whole = fragment.rect, .width = fragment.rect.width()};
  if (const int rows = units_that_fit(out.width, unit)) {
    out.height = rows * unit;
  } else {
    const int columns = units_that_fit(unit, unit);
    if (columns == 0) return std::nullopt;
    // As wide as one another.
    out.width = divided_up(divided_up(out.width, divided_up(out.width, columns * unit)), unit) * unit;
    out.height = unit;
  }
  out.columns = divided_up(out.whole.width(), out.width);
  out.rows = divided_up(out.whole.height(), out.height);
  return out;
}

void copy_tile(const FragmentView& fragment, const Rect& tile, uint8_t* to) {
  const Rect& whole = fragment.rect;
  const uint8_t* from = fragment.payload.data();
  // The next plane: bytes from sample to sample, and pixels a side that share a sample.
  const auto plane = [&](int bytes, int side) {
    const ptrdiff_t stride = static_cast<ptrdiff_t>(divided_up(whole.width(), side)) * bytes;
    to = copy_rows(from + (tile.y0 - whole.y0) / side * stride + (tile.x0 - whole.x0) / side * bytes, stride,
                   static_cast<size_t>(divided_up(tile.width(), side)) * bytes, divided_up(tile.height(), side), to);
    from += stride * divided_up(whole.height(), side);
  };
  const bool rgb = fragment.family == PixelFamily::kRgb;
  const int sample = fragment.codec == Codec::kRaw16 ? 2 : 1;
  if (rgb && sample == 1) {
    plane(3, 1);
  } else {
    plane(sample, 1);
    for (int c = 1; c < 3; c++) plane(sample, rgb ? 1 : 2);
  }
  if (fragment.has_lost) plane(sample, 1);
}

}  // namespace lf::wire
