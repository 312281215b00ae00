// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <string_view>

namespace lf::gl {

// What follows the rule in compute shaders: whose a pixel is.
inline constexpr std::string_view kRuns = R"(
layout(local_size_x = GROUP, local_size_y = GROUP) in;

// For each row of the sum where its runs begin, and where the last one's end, counted in runs; then of each run its
// ends, the first in the low 16 bits, and its face.
layout(std430, binding = RUNS) readonly buffer Runs { uint runs[]; };

// The face that owns a pixel of the sum; -1: none that has a camera of ours.
int face_at(ivec2 at) {
  uint first = runs[at.y], end = runs[at.y + 1], last = end, rows = uint(size.y) + 1u;
  while (first < last) {
    uint middle = (first + last) / 2u;
    if (int(runs[rows + 2u * middle] >> 16) <= at.x)
      first = middle + 1u;
    else
      last = middle;
  }
  if (first == end || int(runs[rows + 2u * first] & 0xffffu) > at.x) return -1;
  return int(runs[rows + 2u * first + 1u]);
}

// Where it is, from where its face counts, whose number is face_row.
vec2 from_anchor(ivec2 at) {
#ifdef RAYS
  return texelFetch(rays, at, 0).xy;
#else
  return vec2(at + origin) - FACE(0).xy;
#endif
}
)";

}  // namespace lf::gl
