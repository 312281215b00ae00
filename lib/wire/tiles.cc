// SPDX-License-Identifier: LGPL-2.1-or-later
#include "wire/tiles.h"

#include <algorithm>
#include <vector>

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
  if (fragment.codec == Codec::kJpeg) return std::nullopt;
  const int unit = fragment.family == PixelFamily::kI420 ? 2 : 1;  // pixels a side that stay together
  const auto units_that_fit = [&](int width) {
    const size_t bytes = raw_size(tile_header(fragment, {0, 0, width, unit}));
    return static_cast<int>(std::min<size_t>(max_bytes / bytes, kMaxViewSize / unit));
  };
  const auto in_columns = [&](int columns) {
    Tiling out{.whole = fragment.rect};
    out.width = divided_up(divided_up(out.whole.width(), columns), unit) * unit;
    out.height = units_that_fit(out.width) * unit;
    if (out.height == 0) return out;
    out.columns = divided_up(out.whole.width(), out.width);
    out.rows = divided_up(out.whole.height(), out.height);
    return out;
  };
  const int widest = units_that_fit(unit) * unit;
  if (widest == 0) return std::nullopt;
  // Row pairs that leave half of a packet empty double the packets: narrower tiles fill them better.
  const int least = units_that_fit(fragment.rect.width()) > 0 ? 1 : divided_up(fragment.rect.width(), widest);
  std::vector<Tiling> choices;
  for (int columns = least; columns <= 2 * least + 6; columns++) {
    choices.push_back(in_columns(columns));
    if (choices.back().count() == 0) choices.pop_back();
  }
  const size_t fewest = std::ranges::min_element(choices, {}, &Tiling::count)->count();
  return *std::ranges::find_if(choices, [&](const Tiling& t) { return 9 * t.count() <= 10 * fewest; });
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
