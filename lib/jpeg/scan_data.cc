// SPDX-License-Identifier: LGPL-2.1-or-later
#include "jpeg/scan_data.h"

#include <algorithm>
#include <cstring>

namespace lf::jpeg {

ScanData unstuff(std::span<const uint8_t> scan, size_t max_segments) {
  ScanData data;
  data.bytes = take_buffer(scan.size() + ScanData::kPadding);
  uint8_t* out = data.bytes.get();
  const auto written = [&] { return static_cast<size_t>(out - data.bytes.get()); };
  size_t begin = 0;
  const uint8_t* in = scan.data();
  const uint8_t* const end = in + scan.size();
  while (in < end) {
    // Up to the next FF, which is entropy-coded itself if a zero follows.
    const auto* ff = static_cast<const uint8_t*>(std::memchr(in, 0xff, static_cast<size_t>(end - in)));
    const auto size = static_cast<size_t>((ff ? ff : end) - in);
    std::memcpy(out, in, size);
    out += size;
    if (!ff) break;
    in = ff + 1;
    while (in < end && *in == 0xff) in++;  // fill bytes before a marker
    if (in == end) break;
    const uint8_t marker = *in++;
    if (marker == 0) {
      *out++ = 0xff;
      continue;
    }
    if (marker < 0xd0 || marker > 0xd7) break;
    // libjpeg, too, thinks that up to two segments may be lost, and that more than that is a damaged marker.
    const size_t missing = (marker - 0xd0 - data.segments.size()) & 7;
    if (missing > 2 || data.segments.size() + 1 + missing >= max_segments) break;
    // Which of them the bytes before the marker belong to is unknown.
    data.segments.push_back({begin, missing > 0 ? begin : written()});
    begin = written();
    data.segments.insert(data.segments.end(), missing, {begin, begin});
  }
  data.segments.push_back({begin, written()});
  std::memset(out, 0, ScanData::kPadding);
  return data;
}

}  // namespace lf::jpeg
