// SPDX-License-Identifier: LGPL-2.1-or-later
#include "wire/payload.h"

#include <algorithm>

#include "wire/bytes.h"

namespace lf::wire {

std::optional<Scans> split_scans(std::span<const uint8_t> payload, bool has_lost) {
  if (!has_lost) return Scans{payload, {}};
  Reader in(payload);
  const uint32_t length = in.get<uint32_t>();
  if (!in.ok() || length > in.left()) return std::nullopt;
  Scans scans;
  scans.pixels = in.get_bytes(length);
  scans.lost = in.get_bytes(in.left());
  return scans;
}

size_t group_size(std::span<const FragmentView> fragments) {
  if (fragments.empty() || fragments[0].codec != Codec::kJpegAtlas) return std::min<size_t>(fragments.size(), 1);
  size_t size = 1;
  while (size < fragments.size() && fragments[size].codec == Codec::kJpegAtlas && fragments[size].payload.empty())
    size++;
  return size;
}

bool any_lost(std::span<const FragmentView> group) {
  return std::ranges::any_of(group, [](const FragmentView& f) { return f.has_lost; });
}

}  // namespace lf::wire
