// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>

#include "base/maths.h"
#include "base/memory.h"
#include "render/sum_planes.h"

namespace lf::jpeg {

// Pixels along a side of a coding unit: an MCU of 4:2:0 for pixels, and a block for missing weight.
inline constexpr int kPixelUnit = 16, kMissingUnit = 8;

// Rounds a size up to whole coding units.
inline int padded(int size, int unit) { return (size + unit - 1) / unit * unit; }

struct CodedSize {
  int width = 0, height = 0;  // whole units, pixels
};
inline CodedSize coded_size(const Rect& rect, int unit) {
  return {padded(rect.width(), unit), padded(rect.height(), unit)};
}

// Return the minimum number of bytes that a scan of this size can have, so that decoders can reject damaged messages
// before they allocate memory. A uniform block has 6 bits of luma (or missing weight) or 4 bits of chroma.
inline size_t min_pixel_scan(const CodedSize& size) {
  return static_cast<size_t>(size.width / kPixelUnit) * (size.height / kPixelUnit) * (4 * 6 + 2 * 4) / 8;
}
inline size_t min_missing_scan(const CodedSize& size) {
  return (static_cast<size_t>(size.width / kMissingUnit) * (size.height / kMissingUnit) * 6 + 7) / 8;
}

// Our baseline JPEGs consist of this header, a scan and EOI. They have no JFIF marker or tables. Messages contain the
// scan only. Sizes of the header (SOI, SOF0 and SOS) in bytes, for three components and for one component.
inline constexpr size_t kPixelHeader = 35, kMissingHeader = 25;
inline constexpr size_t kEoi = 2;

// Encodes fragments as JPEG scans. Headers and tables are left out, because the receiver knows them: baseline, 4:2:0,
// Huffman tables of Annex K, and its quantisation tables scaled by quality as in the IJG library. See wire/spec.md. The
// encoder reuses libjpeg's state, so each thread needs its own.
class FragmentEncoder {
 public:
  FragmentEncoder();
  ~FragmentEncoder();
  FragmentEncoder(FragmentEncoder&&) noexcept;
  FragmentEncoder& operator=(FragmentEncoder&&) noexcept;

  // Append the scan of the pixels or of the missing weight to `out`. `quality` is 1 to 100. Throw Error if the fragment
  // has no family, has more than 65,500 pixels a side, or lacks the missing weight.
  void encode_pixels(const FragmentPlanes& fragment, int quality, ByteBuffer& out);
  void encode_missing(const FragmentPlanes& fragment, int quality, ByteBuffer& out);

 private:
  class Picture;
  std::unique_ptr<Picture> ycbcr_, rgb_, missing_;
};

// Decodes the scans of FragmentEncoder. The input may be untrusted, so anything but a whole scan of the right size
// counts as damaged. The decoder reuses libjpeg's state, tables and planes, so each thread needs its own.
class FragmentDecoder {
 public:
  FragmentDecoder();
  ~FragmentDecoder();
  FragmentDecoder(FragmentDecoder&&) noexcept;
  FragmentDecoder& operator=(FragmentDecoder&&) noexcept;

  // Decode a fragment. The caller must set its family and rectangle. On success, the fragment's planes (or its missing
  // weight) point to memory of this object, which is valid until the next call of the same function. If the scan is
  // damaged, or size, family or quality are invalid, the functions return false and leave the fragment unchanged.
  bool decode_pixels(std::span<const uint8_t> scan, int quality, FragmentPlanes& fragment);
  bool decode_missing(std::span<const uint8_t> scan, int quality, FragmentPlanes& fragment);

 private:
  class Picture;
  std::unique_ptr<Picture> pixels_, missing_;
};

}  // namespace lf::jpeg
