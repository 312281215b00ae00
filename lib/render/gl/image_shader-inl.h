// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <string_view>

namespace lf::gl {

// The fragment shader of CardPieces: divide_by_gain() and sharpen() of image/, in the same integers.
inline constexpr std::string_view kImage = R"(
precision highp float;
precision highp int;
uniform highp sampler2D card_image;
uniform ivec2 origin, size; // where pixel (0, 0) of the plane would be in the target; the plane's size
uniform ivec4 channels; // the one that has the plane, -1: all; gain_factor(), 0: not divided; the value of no colour;
                        // 1: sharpened
layout(location = 0) out highp vec4 result;

ivec4 divided(ivec2 at) {
  vec4 texel = texelFetch(card_image, clamp(at, ivec2(0), size - 1), 0);
  ivec4 value = ivec4(floor(255.0 * (channels.x < 0 ? texel : vec4(texel[max(channels.x, 0)])) + 0.5));
  if (channels.y == 0) return value;
  ivec4 product = (128 * (value - channels.z) * channels.y) >> 16;
  return clamp(((product + 16) >> 5) + channels.z, 0, 255);
}

void main() {
  ivec2 at = ivec2(gl_FragCoord.xy) - origin;
  ivec4 value = divided(at);
  if (channels.w != 0) {
    ivec4 around = divided(at - ivec2(1, 0)) + divided(at + ivec2(1, 0)) + divided(at - ivec2(0, 1)) +
                   divided(at + ivec2(0, 1));
    value = clamp(value + ((SHARPENING * (4 * value - around) + 128) >> 8), 0, 255);
  }
  result = vec4(value) / 255.0;
}
)";

}  // namespace lf::gl
