// SPDX-License-Identifier: LGPL-2.1-or-later
#include "jpeg/scan_data.h"

#include <cstring>

namespace lf::jpeg {
namespace {

const uint8_t* find_ff(const uint8_t* begin, const uint8_t* end) {
  if (begin == end) return end;  // which may be null
  const void* const found = std::memchr(begin, 0xff, static_cast<size_t>(end - begin));
  return found ? static_cast<const uint8_t*>(found) : end;
}

}  // namespace

ScanData::ScanData(std::span<const uint8_t> scan, size_t max_segments) : scan_(scan) {
  bytes_ = take_buffer(scan.size() + kPadding);
  const uint8_t* const first = scan.data();
  const uint8_t* const end = first + scan.size();
  const auto offset = [&](const uint8_t* at) { return static_cast<size_t>(at - first); };
  size_t begin = 0;
  const uint8_t* ff = find_ff(first, end);
  while (ff != end) {
    const uint8_t* next = ff + 1;
    if (next != end && *next == 0) {
      ff = find_ff(next + 1, end);
      continue;
    }
    while (next != end && *next == 0xff) next++;  // fill bytes before a marker
    if (next == end || *next < 0xd0 || *next > 0xd7) break;
    // libjpeg, too, thinks that up to two segments may be lost, and that more than that is a damaged marker. Which of
    // them the bytes before the marker belong to is unknown.
    const size_t missing = (*next - 0xd0 - segments_.size()) & 7;
    if (missing > 2 || segments_.size() + 1 + missing >= max_segments) break;
    segments_.push_back({begin, missing > 0 ? begin : offset(ff)});
    begin = offset(next) + 1;
    segments_.insert(segments_.end(), missing, {begin, begin});
    ff = find_ff(next + 1, end);
  }
  segments_.push_back({begin, offset(ff)});
}

ScanData::Range ScanData::segment(size_t index) {
  if (index >= segments_.size()) return {};
  Segment& s = segments_[index];
  if (s.clean_end == 0 && s.begin != s.end) {
    uint8_t* out = bytes_.get() + s.begin;
    const uint8_t* in = scan_.data() + s.begin;
    const uint8_t* const end = scan_.data() + s.end;
    while (in != end) {
      const uint8_t* const ff = find_ff(in, end);
      const size_t size = static_cast<size_t>(ff - in) + (ff != end);
      std::memcpy(out, in, size);
      out += size;
      in = ff == end ? end : ff + 2;
    }
    // A reader looks at bits that follow the last one; two bytes of a marker, at least, lie between segments.
    out[0] = out[1] = 0;
    s.clean_end = static_cast<size_t>(out - bytes_.get());
  }
  return {s.begin, s.clean_end};
}

}  // namespace lf::jpeg
