// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <string_view>

namespace lf::gl {

// What follows the rule in compute shaders: which view is drawn, and whose a pixel is.
inline constexpr std::string_view kRuns = R"(
layout(local_size_x = GROUP, local_size_y = GROUP) in;

// Words of ViewWord for each view of the pass. Then for each of them: for each row of the sum where its runs begin, and
// where the last one's end, counted in runs; then of each run its ends, the first in the low 16 bits, and its face.
layout(std430, binding = RUNS) readonly buffer Runs { uint runs[]; };
uint first_row;    // of the view's, in `runs`
int first_face;    // row of the tables
uint of_result[6]; // where the view's sum is: kViewResult
uint cells;        // where its cells begin

void begin_view(uint view) {
  uint head = VIEW_WORDS * view;
  origin = ivec2(runs[head + VIEW_ORIGIN], runs[head + VIEW_ORIGIN + 1u]);
  size = ivec2(runs[head + VIEW_SIZE], runs[head + VIEW_SIZE + 1u]);
  first_row = runs[head + VIEW_RUNS];
  first_face = int(runs[head + VIEW_FACES]);
  first_level_row = int(runs[head + VIEW_LEVELS]);
  nodes = ivec2(runs[head + VIEW_NODES], runs[head + VIEW_NODES + 1u]);
  for (uint i = 0u; i < 4u; i++) map_scale[i] = uintBitsToFloat(runs[head + VIEW_SCALE + i]);
  for (uint i = 0u; i < 6u; i++) of_result[i] = runs[head + VIEW_RESULT + i];
  cells = runs[head + VIEW_CELLS];
}

// The row of the tables for the face that owns a pixel of the sum; -1: none that has a camera of ours.
int face_at(ivec2 at) {
  uint row = first_row + uint(at.y), first = runs[row], end = runs[row + 1u], last = end;
  uint all = first_row + uint(size.y) + 1u;
  while (first < last) {
    uint middle = (first + last) / 2u;
    if (int(runs[all + 2u * middle] >> 16) <= at.x)
      first = middle + 1u;
    else
      last = middle;
  }
  if (first == end || int(runs[all + 2u * first] & 0xffffu) > at.x) return -1;
  return first_face + int(runs[all + 2u * first + 1u]);
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
