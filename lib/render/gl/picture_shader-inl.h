// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <string_view>

namespace lf::gl {

// The compute shader of CardSum::draw(): what resolve() of composite/ does, row by row, an invocation does for four
// pixels in a row (RGB), or for eight by two and their chroma.
inline constexpr std::string_view kPicture = R"(
precision highp float;
precision highp int;
layout(local_size_x = GROUP, local_size_y = GROUP) in;

layout(std430, binding = RESULT) readonly buffer Sum { uint sum[]; }; // as BlockSum has it
layout(std430, binding = PICTURE) writeonly buffer Picture { uint picture[]; };
uniform uvec4 parts; // of the sum: pixels, chroma and lost weight; its draw
uniform uint lost_rows; // of the sum
uniform ivec2 origin, size, extent; // where the sum is in the view, and its size; the view's
uniform uvec4 planes; // words of a row of the first plane, and of the others; where these begin
uniform vec3 byte_levels; // gain, offset, chroma's gain
uniform vec4 background; // and the weight that a pixel needs for not showing it
uniform ivec4 channels; // RGB: first bits of red, green, blue and 255, -1: there is none; else w: Cb and Cr are in one

bool is_in_sum(ivec2 at) { return all(greaterThanEqual(at, ivec2(0))) && all(lessThan(at, size)); }

uint word_of(ivec2 at) { return uint(at.y) * (uint(size.x + 1) / 2u) + uint(at.x) / 2u; }

float value(uint word, int n) { return float(bitfieldExtract(int(sum[word]), 16 * n, 16)); }

// Of a pixel of the sum; 32768 is all of it.
float lost_at(ivec2 at) {
  if (sum[lost_rows + uint(at.y / 2)] != parts.w) return 0.0;
  return float(bitfieldExtract(sum[parts.z + word_of(at)], 16 * (at.x & 1), 16));
}

// What sums are multiplied by for levels; 0: the background shows.
float scale_of(float lost) {
  float left = 32768.0 - lost;
  return left >= background.w ? 256.0 / left : 0.0;
}

uint byte_of(float level) { return uint(clamp(level + 0.5, 0.0, 255.0)); }

#ifdef RGB
uint pixel_at(ivec2 at) {
  vec3 colour = vec3(0.0);
  if (is_in_sum(at)) {
    float scale = scale_of(lost_at(at));
    uint word = parts.x + 4u * word_of(at) + 2u * uint(at.x & 1);
    colour = scale > 0.0 ? scale * vec3(value(word, 0), value(word, 1), value(word + 1u, 0)) : background.rgb;
  }
  uint pixel = byte_of(colour.r) << channels.r | byte_of(colour.g) << channels.g | byte_of(colour.b) << channels.b;
  return channels.w >= 0 ? pixel | 255u << channels.w : pixel;
}

void main() {
  ivec2 first = ivec2(4, 1) * ivec2(gl_GlobalInvocationID.xy);
  if (any(greaterThanEqual(first, extent))) return;
  uint pixels[4];
  for (int i = 0; i < 4; i++) pixels[i] = first.x + i < extent.x ? pixel_at(first + ivec2(i, 0) - origin) : 0u;
  uint words[4];
  int count = channels.w >= 0 ? 4 : 3;
  if (count == 4) {
    for (int i = 0; i < 4; i++) words[i] = pixels[i];
  } else {
    words[0] = pixels[0] | pixels[1] << 24;
    words[1] = pixels[1] >> 8 | pixels[2] << 16;
    words[2] = pixels[2] >> 16 | pixels[3] << 8;
    words[3] = 0u;
  }
  uint column = uint(first.x / 4 * count);
  for (int i = 0; i < count; i++)
    if (column + uint(i) < planes.x) picture[uint(first.y) * planes.x + column + uint(i)] = words[i];
}
#else
// Pixels of a chroma sample: how many there are, what they have lost, and how many show the background.
struct Block { float pixels, lost, hidden; };

float luma_at(ivec2 at, inout Block block) {
  block.pixels += 1.0;
  float shown = 0.0;
  if (is_in_sum(at)) {
    float lost = lost_at(at), scale = scale_of(lost);
    block.lost += min(lost, 32768.0);
    if (scale == 0.0) block.hidden += 1.0;
    shown = scale > 0.0 ? scale * value(parts.x + word_of(at), at.x & 1) : background.x;
  }
  return byte_levels.x * shown + byte_levels.y;
}

uvec2 chroma_at(ivec2 at, Block block) {
  vec2 sums = vec2(0.0);
  if (is_in_sum(at)) {
    uint word = parts.y + word_of(ivec2(at.x, at.y / 2));
    sums = vec2(value(word, 0), value(word, 1));
  }
  float scale = scale_of(block.lost / block.pixels), share = scale > 0.0 ? block.hidden / block.pixels : 1.0;
  vec2 shown = mix(clamp(scale * sums, -128.0, 127.0), background.yz, share);
  return uvec2(byte_of(128.0 + byte_levels.z * shown.x), byte_of(128.0 + byte_levels.z * shown.y));
}

void main() {
  ivec2 group = ivec2(gl_GlobalInvocationID.xy), first = ivec2(8, 2) * group;
  if (any(greaterThanEqual(first, extent))) return;
  uint luma[4], chroma[2]; // words of two rows; of Cb and Cr, or of both
  for (int i = 0; i < 4; i++) luma[i] = 0u;
  chroma[0] = chroma[1] = 0u;
  for (int n = 0; n < 4; n++) {
    if (first.x + 2 * n >= extent.x) break;
    Block block = Block(0.0, 0.0, 0.0);
    for (int m = 0; m < 4; m++) {
      ivec2 offset = ivec2(2 * n + (m & 1), m >> 1), at = first + offset;
      if (any(greaterThanEqual(at, extent))) continue;
      luma[2 * offset.y + offset.x / 4] |= byte_of(luma_at(at - origin, block)) << (8 * (offset.x & 3));
    }
    uvec2 both = chroma_at(first + ivec2(2 * n, 0) - origin, block);
    if (channels.w != 0) {
      chroma[n / 2] |= (both.x | both.y << 8) << (16 * (n & 1));
    } else {
      chroma[0] |= both.x << (8 * n);
      chroma[1] |= both.y << (8 * n);
    }
  }
  for (int j = 0; j < 2; j++)
    for (int i = 0; i < 2; i++) {
      uint column = uint(2 * group.x + i);
      if (column < planes.x && first.y + j < extent.y)
        picture[uint(first.y + j) * planes.x + column] = luma[2 * j + i];
    }
  uint row = uint(group.y) * planes.y;
  if (channels.w != 0) {
    for (int i = 0; i < 2; i++)
      if (uint(2 * group.x + i) < planes.y) picture[planes.z + row + uint(2 * group.x + i)] = chroma[i];
  } else {
    picture[planes.z + row + uint(group.x)] = chroma[0];
    picture[planes.w + row + uint(group.x)] = chroma[1];
  }
}
#endif
)";

}  // namespace lf::gl
