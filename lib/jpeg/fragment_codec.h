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

// The size that a fragment is coded in, which is part of the wire format.

// Pixels along a side of what is coded as one: the MCU of 4:2:0 for the pixels, a block for the plane of lost weight.
inline constexpr int kPixelUnit = 16, kLostUnit = 8;

inline int padded(int size, int unit) { return (size + unit - 1) / unit * unit; }

struct CodedSize {
  int width = 0, height = 0;  // pixels, whole units
};
inline CodedSize coded_size(const Rect& rect, int unit) {
  return {padded(rect.width(), unit), padded(rect.height(), unit)};
}

// No scan of this size is shorter: a block of one grey is 6 bits of luma (or lost weight) or 4 of chroma. What a
// decoder asks before it makes room for the picture.
inline size_t least_pixel_scan(const CodedSize& size) {
  return static_cast<size_t>(size.width / kPixelUnit) * (size.height / kPixelUnit) * (4 * 6 + 2 * 4) / 8;
}
inline size_t least_lost_scan(const CodedSize& size) {
  return (static_cast<size_t>(size.width / kLostUnit) * (size.height / kLostUnit) * 6 + 7) / 8;
}

// A baseline JPEG of ours is this header, a scan and EOI: no JFIF marker, no tables. Only the scan travels.
inline constexpr size_t kPixelHeader = 35, kLostHeader = 25;  // bytes of SOI, SOF0, SOS for three components, for one
inline constexpr size_t kEoi = 2;

// Fragments as JPEG, without what the receiver knows: a scan and nothing else. Baseline, 4:2:0, the Huffman tables of
// Annex K, its quantisation tables scaled by the quality as the IJG's library does; see spec.md of wire/.
//
// Keeps libjpeg's state from call to call. One for each thread.
class FragmentEncoder {
 public:
  FragmentEncoder();
  ~FragmentEncoder();
  FragmentEncoder(FragmentEncoder&&) noexcept;
  FragmentEncoder& operator=(FragmentEncoder&&) noexcept;

  // Append one scan to `out`: of the pixels; of the lost weight, which the fragment has. `quality` 1 to 100. A fragment
  // without a family or with more than 65,500 pixels a side is an Error.
  void encode_pixels(const FragmentPlanes& fragment, int quality, ByteBuffer& out);
  void encode_lost(const FragmentPlanes& fragment, int quality, ByteBuffer& out);

 private:
  class Picture;
  std::unique_ptr<Picture> ycbcr_, rgb_, lost_;
};

// The way back from FragmentEncoder. Bytes may be anything: what is not a whole scan of the picture's size is damaged.
// Keeps libjpeg's state, tables and planes from call to call. One for each thread.
class FragmentDecoder {
 public:
  FragmentDecoder();
  ~FragmentDecoder();
  FragmentDecoder(FragmentDecoder&&) noexcept;
  FragmentDecoder& operator=(FragmentDecoder&&) noexcept;

  // Decodes a fragment whose family and rectangle the caller has set, and points its planes (or its lost weight) into
  // memory of this object, valid until the next call of the same function. False, and the fragment as it was, if the
  // scan is damaged or the size, the family or the quality is not what FragmentEncoder makes.
  bool decode_pixels(std::span<const uint8_t> scan, int quality, FragmentPlanes& fragment);
  bool decode_lost(std::span<const uint8_t> scan, int quality, FragmentPlanes& fragment);

 private:
  class Picture;
  std::unique_ptr<Picture> pixels_, lost_;
};

}  // namespace lf::jpeg
