// SPDX-License-Identifier: LGPL-2.1-or-later
// Finding units in a stream of bytes that comes in pieces, as lfparse does it: every byte is either of a unit or passed
// over, and where the pieces end makes no difference.
#include <string>

#include "fuzz/fuzz.h"
#include "wire/unit.h"

namespace {

using Bytes = std::span<const uint8_t>;

// Sizes of units, negative for bytes passed over (neighbouring ones together).
std::vector<int64_t> cut(Bytes stream, size_t piece) {
  std::vector<int64_t> out;
  size_t begin = 0, end = std::min(piece, stream.size());
  while (begin < stream.size()) {
    const bool more = end < stream.size();
    const Bytes bytes = stream.subspan(begin, end - begin);
    const std::optional<lf::wire::UnitHeader> unit = lf::wire::peek_unit(bytes);
    if (more && (bytes.size() < lf::wire::kUnitHeaderBytes || (unit && unit->size > bytes.size()))) {
      end = std::min(end + piece, stream.size());
    } else if (unit && unit->size <= bytes.size()) {
      out.push_back(static_cast<int64_t>(unit->size));
      begin += unit->size;
    } else {
      const size_t count = lf::wire::distance_to_magic(bytes, more);
      lf::fuzz::require(count > 0 && count <= bytes.size());
      if (out.empty() || out.back() > 0) out.push_back(0);
      out.back() -= static_cast<int64_t>(count);
      begin += count;
    }
    end = std::max(end, begin);
  }
  return out;
}

}  // namespace

LF_FUZZ_TARGET(framing)(const uint8_t* data, size_t size) {
  lf::fuzz::Input input(data, size);
  const size_t piece = 1 + input.number(1);
  const Bytes stream = input.take(size);
  const std::vector<int64_t> whole = cut(stream, stream.size() + 1);
  lf::fuzz::require(cut(stream, piece) == whole);
  size_t sum = 0;
  for (const int64_t part : whole) sum += static_cast<size_t>(std::abs(part));
  lf::fuzz::require(sum == stream.size());
  return 0;
}
