// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstdint>
#include <optional>

#include "wire/answer.h"

namespace lf::wire {

// Raw fragments (kRaw, kRaw16) cut into smaller ones that together are the same: for links that lose packets, where a
// fragment larger than a packet would be lost with any of its packets. Pure functions.

// Tiles side by side and below one another, row by row; those at the right and at the bottom may be smaller. Chroma
// samples are never cut.
struct Tiling {
  Rect whole;                 // the fragment's rectangle in the view
  int width = 0, height = 0;  // pixels of a tile
  int columns = 0, rows = 0;  // how many tiles there are

  size_t count() const { return static_cast<size_t>(columns) * rows; }
  Rect tile(size_t i) const;  // the rectangle of tile i in the view
};

// Few tiles whose payloads have at most `max_bytes` each: as wide as possible, strips of rows at best, unless narrower
// ones are fewer by a tenth. Nothing if not even the smallest one does, or for JPEG.
std::optional<Tiling> tile_raw(const FragmentHeader& fragment, size_t max_bytes);

// The header of a fragment that is the tile of another one.
FragmentHeader tile_header(const FragmentHeader& fragment, const Rect& tile);

// The payload of one tile, raw_size(tile_header(...)) bytes, to `to`.
void copy_tile(const FragmentView& fragment, const Rect& tile, uint8_t* to);

}  // namespace lf::wire
