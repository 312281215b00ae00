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

// Encoded sums are cut into fragments of about this many pixels, so that several threads can encode and decode, and a
// lost packet loses only a strip of the view.
inline constexpr int kStripPixels = 1 << 16, kStripUnit = 16;

inline int strip_rows(int width, int pixels = kStripPixels) {
  return std::max(pixels / width / kStripUnit, 1) * kStripUnit;
}

inline std::vector<Rect> cut_rows(const Rect& rect, int rows) {
  std::vector<Rect> parts;
  for (int y = rect.y0; y < rect.y1; y += rows) parts.push_back({rect.x0, y, rect.x1, std::min(y + rows, rect.y1)});
  return parts;
}

// Cuts raw fragments (kRaw, kRaw16) into smaller fragments with the same content, for links that lose packets: a
// fragment that spans several packets would be lost with any of its packets. Pure functions.

// Tiles in row-major order; the rightmost and bottom tiles may be smaller. Chroma samples are never cut.
struct Tiling {
  Rect whole;                 // in the view
  int width = 0, height = 0;  // pixels of a tile
  int columns = 0, rows = 0;

  size_t count() const { return static_cast<size_t>(columns) * rows; }
  Rect tile(size_t i) const;
};

// Returns a tiling with few tiles of at most `max_bytes` payload: strips of full rows if possible, unless narrower
// tiles need at least a tenth fewer tiles. Returns nullopt for JPEG, or if even the smallest tile is too large.
std::optional<Tiling> tile_raw(const FragmentHeader& fragment, size_t max_bytes);

FragmentHeader tile_header(const FragmentHeader& fragment, const Rect& tile);

// Writes the payload of a tile, raw_size(tile_header(...)) bytes, to `to`.
void copy_tile(const FragmentView& fragment, const Rect& tile, uint8_t* to);

// FragmentEncoder and FragmentDecoder convert between fragments and payloads. Both reuse memory and libjpeg's state:
// use one object per thread.

// Minimum JPEG quality of missing weight. Errors in the missing weight scale the view, so it needs a finer quality than
// the pixels.
inline constexpr int kMinMissingQuality = 90;

struct AnswerFragment {
  std::optional<CameraIndex> camera;  // see FragmentHeader
  FragmentPlanes planes;
};

class FragmentEncoder {
 public:
  // Encodes a whole answer of 8-bit fragments. `quality` 0: raw; 1 to 100: JPEG. `memory`: see AnswerWriter. Throws
  // Error like AnswerWriter, and for planes that do not fill their rectangles.
  ByteBuffer encode(const AnswerHeader& header, std::span<const Fragment> fragments, int quality,
                    ByteBuffer memory = {});
  ByteBuffer encode(const AnswerHeader& header, std::span<const AnswerFragment> fragments, int quality,
                    ByteBuffer memory = {});

  void encode_payload(const FragmentPlanes& fragment, int quality, ByteBuffer& out);

 private:
  jpeg::FragmentEncoder jpeg_;
};

// Encodes like FragmentEncoder::encode(), bit-identical, in several threads with an encoder each.
ByteBuffer encode_fragments(const AnswerHeader& header, std::span<const AnswerFragment> fragments, int quality,
                            ByteBuffer memory, const ParallelFor& parallel);

class FragmentDecoder {
 public:
  // Returns the planes of a fragment with 8 bits per value. Raw planes point into the payload; JPEG is decoded into
  // memory of this object, valid until the next call. Returns nullopt for a damaged JPEG or a 16-bit fragment.
  std::optional<FragmentPlanes> decode(const FragmentView& fragment);

  // Returns the planes of a 16-bit fragment. The planes point into the payload, or at an odd address into a copy in
  // this object (valid until the next call). `*copied` (may be null) is true for a copy.
  ConstSumPlanes sums(const FragmentView& fragment, bool* copied = nullptr);

 private:
  jpeg::FragmentDecoder jpeg_;
  UninitializedVector<uint16_t> aligned_;
};

}  // namespace lf::wire
