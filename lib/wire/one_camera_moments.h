// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "base/rect.h"
#include "focus/moments.h"

namespace lf::wire {

// Moments in which there is one camera alone, in less: its weight and, for each trial, a luma, or that it sees nothing.
// Other moments follow from that. See spec.md.
inline size_t packed_bytes(size_t nodes, size_t trials) { return nodes * (4 + trials); }
// Packs the moments of the nodes in a rectangle; nothing where several cameras are in the sums.
std::optional<std::vector<uint8_t>> pack_one_camera(std::span<const Moments> trials, const Rect& rect);
// `packed`: packed_bytes() for all nodes of `trials`, which are empty. Throws Error for what no camera can see.
void unpack_one_camera(std::span<const uint8_t> packed, std::span<Moments> trials);

}  // namespace lf::wire
