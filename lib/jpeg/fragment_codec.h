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

// Coded size of fragments, which is part of the wire format.

// Pixels along a side of a coding unit: the MCU of 4:2:0 for pixels, a block for the plane of missing weight.
inline constexpr int kPixelUnit = 16, kMissingUnit = 8;

inline int padded(int size, int unit) { return (size + unit - 1) / unit * unit; }

struct CodedSize {
  int width = 0, height = 0;  // pixels, whole units
};
inline CodedSize coded_size(const Rect& rect, int unit) {
  return {padded(rect.width(), unit), padded(rect.height(), unit)};
}

// Return the minimum bytes of a scan of this size: a uniform block has 6 bits of luma (or missing weight) or 4 of
// chroma. Decoders check this before they allocate memory.
inline size_t min_pixel_scan(const CodedSize& size) {
  return static_cast<size_t>(size.width / kPixelUnit) * (size.height / kPixelUnit) * (4 * 6 + 2 * 4) / 8;
}
inline size_t min_missing_scan(const CodedSize& size) {
  return (static_cast<size_t>(size.width / kMissingUnit) * (size.height / kMissingUnit) * 6 + 7) / 8;
}

// Our baseline JPEGs consist of this header, a scan and EOI, without JFIF marker or tables. Messages contain the scan
// only. Header bytes: SOI, SOF0 and SOS, for three components and for a single component.
inline constexpr size_t kPixelHeader = 35, kMissingHeader = 25;
inline constexpr size_t kEoi = 2;

// Encodes fragments as JPEG scans, without headers and tables that the receiver knows: baseline, 4:2:0, Huffman tables
// of Annex K, and its quantisation tables scaled by quality as in the IJG library. See wire/spec.md.
//
// Reuses libjpeg's state. Use one object per thread.
class FragmentEncoder {
 public:
  FragmentEncoder();
  ~FragmentEncoder();
  FragmentEncoder(FragmentEncoder&&) noexcept;
  FragmentEncoder& operator=(FragmentEncoder&&) noexcept;

  // Append the scan of the pixels or of the missing weight to `out`. `quality`: 1 to 100. Throw Error if the fragment
  // has no family, has more than 65,500 pixels a side, or lacks the missing weight.
  void encode_pixels(const FragmentPlanes& fragment, int quality, ByteBuffer& out);
  void encode_missing(const FragmentPlanes& fragment, int quality, ByteBuffer& out);

 private:
  class Picture;
  std::unique_ptr<Picture> ycbcr_, rgb_, missing_;
};

// Decodes the scans of FragmentEncoder. Input may be untrusted: anything but a whole scan of the right size is treated
// as damaged. Reuses libjpeg's state, tables and planes. Use one object per thread.
class FragmentDecoder {
 public:
  FragmentDecoder();
  ~FragmentDecoder();
  FragmentDecoder(FragmentDecoder&&) noexcept;
  FragmentDecoder& operator=(FragmentDecoder&&) noexcept;

  // Decode a fragment. The caller must set its family and rectangle. On success the fragment's planes (or its missing
  // weight) point to memory of this object, valid until the next call of the same function. Return false and leave the
  // fragment unchanged if the scan is damaged, or if size, family or quality are invalid.
  bool decode_pixels(std::span<const uint8_t> scan, int quality, FragmentPlanes& fragment);
  bool decode_missing(std::span<const uint8_t> scan, int quality, FragmentPlanes& fragment);

 private:
  class Picture;
  std::unique_ptr<Picture> pixels_, missing_;
};

}  // namespace lf::jpeg
