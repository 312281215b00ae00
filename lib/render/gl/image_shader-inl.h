// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <string_view>

namespace lf::gl {

// The compute shader of CardPieces: divide_by_gain() and sharpen() of image/, in the same integers. An invocation makes
// a word, a pixel of RGB or four samples of a plane.
inline constexpr std::string_view kImage = R"(
precision highp float;
precision highp int;
layout(local_size_x = GROUP, local_size_y = GROUP) in;

layout(std430, binding = RESULT) writeonly buffer Result { uint result[]; };
uniform highp sampler2D card_image;
uniform ivec2 origin, size, extent; // the first pixel that is wanted; the plane's size; words that are wanted
uniform uvec4 parts;    // the first word, and words of a row
uniform ivec4 channels; // the one that has the plane, -1: all; gain_factor(), 0: not divided; the value of no colour;
                        // 1: sharpened

ivec4 divided(ivec2 at) {
  vec4 texel = texelFetch(card_image, clamp(at, ivec2(0), size - 1), 0);
  ivec4 value = ivec4(floor(255.0 * (channels.x < 0 ? texel : vec4(texel[max(channels.x, 0)])) + 0.5));
  if (channels.y == 0) return value;
  ivec4 product = (128 * (value - channels.z) * channels.y) >> 16;
  return clamp(((product + 16) >> 5) + channels.z, 0, 255);
}

uvec4 made(ivec2 at) {
  ivec4 value = divided(at);
  if (channels.w != 0) {
    ivec4 around = divided(at - ivec2(1, 0)) + divided(at + ivec2(1, 0)) + divided(at - ivec2(0, 1)) +
                   divided(at + ivec2(0, 1));
    value = clamp(value + ((SHARPENING * (4 * value - around) + 128) >> 8), 0, 255);
  }
  return uvec4(value);
}

void main() {
  ivec2 word = ivec2(gl_GlobalInvocationID.xy);
  if (any(greaterThanEqual(word, extent))) return;
  uvec4 bytes;
  if (channels.x < 0) {
    bytes = made(origin + word);
  } else {
    for (int n = 0; n < 4; n++) bytes[n] = made(origin + ivec2(4 * word.x + n, word.y)).x;
  }
  result[parts.x + uint(word.y) * parts.y + uint(word.x)] = bytes.x | bytes.y << 8 | bytes.z << 16 | bytes.w << 24;
}
)";

}  // namespace lf::gl
