// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "jpeg/buffer_pool.h"

namespace lf::jpeg {

// The entropy-coded bytes of a scan without what stuffs and divides them, so that a reader may load eight at a time.
struct ScanData {
  // What lies between two restart markers, [begin, end) in `bytes`. Empty: it never arrived.
  struct Segment {
    size_t begin = 0, end = 0;
  };
  PooledBuffer bytes;             // kPadding zeros follow the last segment
  std::vector<Segment> segments;  // the first ones of the scan, at least one; all of them unless the scan is cut short

  // More than the longest MCU has bytes: 10 blocks of 64 coefficients with codes of 16 bits and 15 bits of value.
  static constexpr size_t kPadding = 2560;
};

// `scan` begins with the first entropy-coded byte and ends anywhere after the last; any marker but a restart marker
// ends the scan. At most max_segments (> 0) are looked for: restart markers beyond are taken for the end. Where a
// restart marker's number says that one or two segments are missing, these and the one before it are entered empty;
// with any other wrong number the scan ends.
ScanData unstuff(std::span<const uint8_t> scan, size_t max_segments);

}  // namespace lf::jpeg
