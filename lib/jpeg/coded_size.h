// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstddef>

#include "base/rect.h"

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

}  // namespace lf::jpeg
