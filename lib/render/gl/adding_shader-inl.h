// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <string_view>

namespace lf::gl {

// The compute shader of BlockSums::add(): an invocation adds a word of one part of a sum, two samples, to where it
// belongs in a larger sum, or clears one.
inline constexpr std::string_view kAdding = R"(
precision highp float;
precision highp int;
layout(local_size_x = GROUP, local_size_y = GROUP) in;

layout(std430, binding = RESULT) buffer Result { uint result[]; };
layout(std430, binding = PICTURE) readonly buffer Part { uint part[]; };
uniform ivec2 size;   // of the part, words
uniform uvec4 parts;  // the first word of the part, and words of its rows; where the first one goes, and words there
uniform uvec4 planes; // kAdd, kAddLost or else to clear; of lost weight the word of the first row with loss; the draw

const uint kAdd = 0u, kAddLost = 1u;

void main() {
  ivec2 at = ivec2(gl_GlobalInvocationID.xy);
  if (any(greaterThanEqual(at, size))) return;
  uint to = parts.z + uint(at.y) * parts.w + uint(at.x);
  if (planes.x > kAddLost) {
    result[to] = 0u;
    return;
  }
  uint more = part[parts.x + uint(at.y) * parts.y + uint(at.x)], before = result[to];
  if (planes.x == kAdd) {
    ivec2 a = ivec2(bitfieldExtract(int(before), 0, 16), int(before) >> 16);
    ivec2 b = ivec2(bitfieldExtract(int(more), 0, 16), int(more) >> 16);
    uvec2 sum = uvec2(clamp(a + b, -32768, 32767)) & 0xffffu;
    result[to] = sum.x | sum.y << 16;
  } else {
    uvec2 a = uvec2(before & 0xffffu, before >> 16), b = uvec2(more & 0xffffu, more >> 16), sum = min(a + b, 0xffffu);
    result[to] = sum.x | sum.y << 16;
    if (result[to] != 0u) result[planes.y + uint(at.y) / 2u] = planes.w;
  }
}
)";

}  // namespace lf::gl
