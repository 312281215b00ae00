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

// Approximate number of pixels in a fragment of an encoded sum (the weighted total of a node's cameras). Sums are cut
// into strips of this size, so that several threads can encode and decode the strips.
inline constexpr int kStripPixels = 1 << 16, kStripUnit = 16;

// Returns the number of rows of a strip with about `pixels` pixels, a multiple of 16, so that JPEG blocks are not cut.
inline int strip_rows(int width, int pixels = kStripPixels) {
  return std::max(pixels / width / kStripUnit, 1) * kStripUnit;
}

// Cuts a rectangle into strips of `rows` rows; the last strip may be smaller.
inline std::vector<Rect> cut_rows(const Rect& rect, int rows) {
  std::vector<Rect> parts;
  for (int y = rect.y0; y < rect.y1; y += rows) parts.push_back({rect.x0, y, rect.x1, std::min(y + rows, rect.y1)});
  return parts;
}

// The functions below cut raw fragments (kRaw, kRaw16) into smaller fragments with the same content.

// A grid of tiles in row-major order. The rightmost and bottom tiles may be smaller. Chroma samples are never cut.
struct Tiling {
  Rect whole;  // the fragment's rectangle in the view
  int width = 0, height = 0;
  int columns = 0, rows = 0;

  size_t count() const { return static_cast<size_t>(columns) * rows; }
  Rect tile(size_t i) const;
};

// Returns a grid with few tiles, each with at most `max_bytes` of payload. Tiles are strips of full rows, unless
// narrower tiles reduce their number by at least a tenth. Returns nullopt for a JPEG fragment, or if even the smallest
// tile is too large.
std::optional<Tiling> tile_raw(const FragmentHeader& fragment, size_t max_bytes);

FragmentHeader tile_header(const FragmentHeader& fragment, const Rect& tile);

// Writes the payload of a tile to `to`. Its size is raw_size(tile_header(...)).
void copy_tile(const FragmentView& fragment, const Rect& tile, uint8_t* to);

// Minimum JPEG quality of missing weight. The compositor scales pixels by the missing weight, so errors in it are more
// visible than errors in the pixels.
inline constexpr int kMinMissingQuality = 90;

// A fragment to encode: the planes of its pixels, and the camera if these are the unprocessed pixels of one camera.
struct AnswerFragment {
  std::optional<CameraIndex> camera;
  FragmentPlanes planes;
};

// Encodes a whole answer of 8-bit fragments: without compression if `quality` is 0, or as JPEG with quality 1 to 100.
// `memory` is reused as in AnswerWriter. The result does not depend on `parallel`. Throws Error in the same cases as
// AnswerWriter.
ByteBuffer encode_fragments(const AnswerHeader& header, std::span<const AnswerFragment> fragments, int quality,
                            ByteBuffer memory = {}, const ParallelFor& parallel = serial_for);

// Appends the payload of a fragment with the codec kJpeg.
void append_jpeg(const FragmentPlanes& fragment, int quality, ByteBuffer& out);

// Converts payloads to fragments. Reuses memory and libjpeg's state, so each thread needs its own object.
class FragmentDecoder {
 public:
  // Returns the planes of a fragment with 8 bits per value. Raw planes point into the payload. JPEG is decoded into
  // memory of this object, which is valid until the next call. Returns nullopt for a damaged JPEG or a 16-bit fragment.
  std::optional<FragmentPlanes> decode(const FragmentView& fragment);

  // Returns the planes of a 16-bit fragment. They point into the payload if its address is even. Otherwise they point
  // into an aligned copy in this object, which is valid until the next call. `*copied`, unless null, is true if a copy
  // was made.
  ConstSumPlanes sums(const FragmentView& fragment, bool* copied = nullptr);

 private:
  jpeg::FragmentDecoder jpeg_;
  UninitializedVector<uint16_t> aligned_;
};

}  // namespace lf::wire
