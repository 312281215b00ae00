// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "jpeg/buffer_pool.h"

namespace lf::jpeg {

// The entropy-coded bytes of a scan, divided at its restart markers, and without the zeros that are stuffed in after FF
// where they are needed: a reader may then load eight bytes at a time. Not thread-safe.
class ScanData {
 public:
  // More than the longest MCU has bytes: 10 blocks of 64 coefficients with codes of 16 bits and 15 bits of value.
  static constexpr size_t kPadding = 2560;

  // `scan` begins with the first entropy-coded byte and ends anywhere after the last; any marker but a restart marker
  // ends the scan. It has to outlive this object. At most max_segments (> 0) are looked for: restart markers beyond are
  // taken for the end. Where a restart marker's number says that one or two segments are missing, these and the one
  // before it are entered empty; with any other wrong number the scan ends.
  ScanData(std::span<const uint8_t> scan, size_t max_segments);

  // The number of segments up to where the scan ends, at least one.
  size_t segments() const { return segments_.size(); }
  // Offsets in bytes() of a segment; empty if there is none of that index.
  struct Range {
    size_t begin = 0, end = 0;
  };
  Range segment(size_t index);
  // kPadding bytes can be read after any segment, whatever they are.
  const uint8_t* bytes() const { return bytes_.get(); }

 private:
  struct Segment {
    size_t begin = 0, end = 0;  // range of the stuffed bytes
    size_t clean_end = 0;       // where the clean bytes end, from `begin` in bytes_, once they are there
  };
  std::span<const uint8_t> scan_;
  std::vector<Segment> segments_;
  PooledBuffer bytes_;
};

}  // namespace lf::jpeg
