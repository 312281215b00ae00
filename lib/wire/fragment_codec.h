// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <algorithm>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "base/maths.h"
#include "base/memory.h"
#include "base/worker_pool.h"
#include "jpeg/fragment_codec.h"
#include "render/sum_planes.h"
#include "wire/answer_codec.h"

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

// FragmentEncoder makes payloads of fragments, FragmentDecoder fragments of payloads. Both keep memory and libjpeg's
// state from call to call: one object for each thread.

// Lost weight divides the picture: it is coded finer than the pixels (at most as coarse as this).
inline constexpr int kLeastLostQuality = 90;

// A fragment that an answer is to have, 8 bits a value.
struct AnswerFragment {
  std::optional<CameraIndex> camera;  // see FragmentHeader
  FragmentPlanes planes;
};

class FragmentEncoder {
 public:
  // A whole answer of 8-bit fragments. `quality` 0: raw; 1 to 100: JPEG. `memory`: see AnswerWriter. Throws Error as
  // AnswerWriter does, and for planes that do not fill their rectangles.
  ByteBuffer encode(const AnswerHeader& header, std::span<const Fragment> fragments, int quality,
                    ByteBuffer memory = {});
  ByteBuffer encode(const AnswerHeader& header, std::span<const AnswerFragment> fragments, int quality,
                    ByteBuffer memory = {});

  // Appends the JPEG payload of one fragment.
  void encode_payload(const FragmentPlanes& fragment, int quality, ByteBuffer& out);

 private:
  jpeg::FragmentEncoder jpeg_;
};

// The bytes that FragmentEncoder::encode() gives, by several threads, each with an encoder of its own.
ByteBuffer encode_fragments(const AnswerHeader& header, std::span<const AnswerFragment> fragments, int quality,
                            ByteBuffer memory, const ParallelFor& parallel);

class FragmentDecoder {
 public:
  // The planes of a fragment of 8 bits a value: raw ones where they lie, JPEG decoded into memory of this object, valid
  // until the next call. Nothing if the JPEG is damaged, or for a fragment of 16 bits.
  std::optional<FragmentPlanes> decode(const FragmentView& fragment);

  // The planes of a 16-bit fragment: where they lie, or copied into memory of this object (valid until the next call)
  // if it lies at an odd address. `*copied` (may be null) says which.
  ConstSumPlanes sums(const FragmentView& fragment, bool* copied = nullptr);

 private:
  jpeg::FragmentDecoder jpeg_;
  UninitializedVector<uint16_t> aligned_;
};

}  // namespace lf::wire
