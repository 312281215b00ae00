// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <string_view>

namespace lf::gl {

// What follows the rule and kRuns in the compute shader of MomentSums: an invocation computes two nodes, side by
// side, through one surface.
inline constexpr std::string_view kMoments = R"(
// Levels of the sum's nodes through each surface, four in 32 bits, whole words in each row.
layout(std430, binding = SURFACES) readonly buffer Surfaces { uint surfaces[]; };
// Of each surface planes of weight, luma and square, two nodes in 32 bits.
layout(std430, binding = RESULT) writeonly buffer Result { uint result[]; };

uint level_of(int surface, ivec2 at) {
  int word = (surface * size.y + at.y) * ((size.x + 3) / 4) + at.x / 4;
  return (surfaces[word] >> uint(8 * (at.x & 3))) & 255u;
}

// Where camera k's image has the node, and whether it does.
bool sees(int k, vec2 d, float level, out vec2 position) {
  vec3 x = camera_point(k, d, (level - FACE(0).w) * map_scale.z);
  vec2 u = x.xy / x.z;
  vec4 image = corner(k, CORNER_IMAGE);
  position = through_lens(k, u);
  bool is_before_eye = x.z > 0.0 && (map_scale.y + level * map_scale.z) * map_scale.w < 1.0;
  bool seen = is_before_eye && (int(corner(k, CORNER_ALONG).w) & HAS_IMAGE) != 0;
#ifdef DISTORTED
  seen = seen && dot(u, u) <= image.z;
#endif
  return seen && all(greaterThanEqual(position, vec2(-0.5))) && all(lessThanEqual(position, image.xy - 0.5));
}

// In levels. What lies beyond the image's edges is as it is there.
int luma_at(int k, ivec2 pixel) {
  ivec2 last = ivec2(corner(k, CORNER_IMAGE).xy) - 1;
  ivec2 at = place_of(k) + clamp(pixel, ivec2(0), last);
  vec4 bytes = texelFetch(images, clamp(at, ivec2(0), textureSize(images, 0) - 1), 0);
#ifdef RGB
  ivec3 rgb = ivec3(255.0 * rgb_of(k, bytes) + 0.5);
  return (77 * rgb.r + 150 * rgb.g + 29 * rgb.b + 128) >> 8;
#else
  return int(255.0 * bytes.r + 0.5);
#endif
}

// Of pixel `at`, its neighbours to the right and below, and the one to the right and below: the mean of the box of 4 x
// 4 pixels around the corner that it has in common with the latter.
ivec4 means_of_sixteen(int k, ivec2 at) {
  ivec4 sums = ivec4(8);
  for (int j = -1; j < 4; j++) {
    int middle = luma_at(k, at + ivec2(0, j)) + luma_at(k, at + ivec2(1, j)) + luma_at(k, at + ivec2(2, j));
    ivec2 row = middle + ivec2(luma_at(k, at + ivec2(-1, j)), luma_at(k, at + ivec2(3, j)));
    if (j < 3) sums.xy += row;
    if (j > -1) sums.zw += row;
  }
  return sums >> 4;
}

// The means of boxes of `box` pixels a side around the same four corners as in means_of_sixteen(): those of more than 4
// are the rounded means of four of half their size. All of the smallest come one after the other, and a larger one is
// complete with its last.
ivec4 means_of_boxes(int k, ivec2 at, int box) {
  ivec4 sums[3] = ivec4[3](ivec4(0), ivec4(0), ivec4(0)), means = ivec4(0);
  for (int n = 0; n < box * box / 16; n++) {
    ivec2 place = at;
    for (int m = 0; 8 << m <= box; m++) place += (2 << m) * (2 * ivec2(n >> (2 * m) & 1, n >> (2 * m + 1) & 1) - 1);
    means = means_of_sixteen(k, place);
    for (int m = 0; 8 << m <= box; m++) {
      sums[m] += means;
      if ((n >> (2 * m) & 3) != 3) break;
      means = (sums[m] + 2) >> 2;
      sums[m] = ivec4(0);
    }
  }
  return means;
}

// Luma at a position in camera k's image, to a level: between the means of the four boxes around it, in 256ths of a
// pixel.
uint sampled_luma(int k, vec2 position) {
  ivec2 at = ivec2(256.0 * clamp(position - 0.5, vec2(0.0), corner(k, CORNER_IMAGE).xy - 1.0));
  ivec4 means = means_of_boxes(k, at >> 8, int(corner(k, CORNER_PER_FROM).w));
  ivec2 part = at & 255, sides = means.xz * (256 - part.x) + means.yw * part.x;
  return uint((sides.x * (256 - part.y) + sides.y * part.y + (1 << 15)) >> 16);
}

// What a node's cameras add, of these weights.
uvec3 moments_of(vec3 weights, vec2 d, float level) {
  uvec3 sum = uvec3(0u);
  for (int k = 0; k < 3; k++) {
    vec2 position;
    if (!(weights[k] > 0.0) || !sees(k, d, level, position)) continue;
    uint weight = uint(weights[k] * 32768.0 + 0.5), value = sampled_luma(k, position);
    uint luma = (weight * value + 128u) >> 8;
    sum += uvec3(weight, luma, (luma * value + 64u) >> 7);
  }
  return min(sum, uvec3(0xffffu));
}

void main() {
  begin_view(0u);
  ivec2 first = ivec2(2, 1) * ivec2(gl_GlobalInvocationID.xy);
  int surface = int(gl_GlobalInvocationID.z);
  if (any(greaterThanEqual(first, size))) return;
  uvec3 pair = uvec3(0u);
  for (int n = 0; n < 2; n++) {
    ivec2 at = first + ivec2(n, 0);
    face_row = at.x < size.x ? face_at(at) : -1;
    if (face_row < 0) continue;
    vec2 d = from_anchor(at);
    pair |= moments_of(weights_at(d), d, float(level_of(surface, at))) << (16 * n);
  }
  uint row_words = uint(size.x + 1) / 2u, plane = row_words * uint(size.y);
  uint word = uint(first.y) * row_words + uint(first.x) / 2u;
  for (int m = 0; m < 3; m++) result[uint(3 * surface + m) * plane + word] = pair[m];
}
)";

}  // namespace lf::gl
