// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <string_view>

namespace lf::gl {

// What follows the rule and kRuns in the compute shader of BlockSums: an invocation computes two by two pixels and
// their chroma, and writes what they come to.
inline constexpr std::string_view kBlocks = R"(
// Of each view, as of_result has it: a word for each row of blocks, the draw's number if that has lost weight or doubts,
// else anything; another one for each, the draw's number if it has doubts; pixels, chroma and lost weight as in
// DrawnSum, two samples in 32 bits; the draw's number.
layout(std430, binding = RESULT) writeonly buffer Result { uint result[]; };

// `first`: the block's first pixel. In levels / 128, but for the lost weight, or DOUBT.
void write_block(ivec2 first, vec3 sums[4], uint lost_of[4], vec2 chroma, bool chroma_doubt) {
  ivec2 block = first / 2;
  uint row_words = uint(size.x + 1) / 2u;
  uint any_lost = 0u;
  bool any_doubt = false;
  for (int j = 0; j < 2; j++) {
    int y = first.y + j, left = 2 * j;
    if (y >= size.y) break;
    uint word = uint(y) * row_words + uint(block.x);
#ifdef RGB
    for (int i = 0; i < 2; i++) {
      vec3 sum = sums[left + i];
      uint at = of_result[2] + 4u * word + 2u * uint(i);
      result[at] = bits(sum.r) | bits(sum.g) << 16;
      result[at + 1u] = bits(sum.b);
    }
#else
    result[of_result[2] + word] = bits(sums[left].x) | bits(sums[left + 1].x) << 16;
#endif
    result[of_result[4] + word] = lost_of[left] | lost_of[left + 1] << 16;
    any_lost |= lost_of[left] | lost_of[left + 1];
    any_doubt = any_doubt || lost_of[left] == uint(DOUBT) || lost_of[left + 1] == uint(DOUBT);
  }
#ifndef RGB
  uint chroma_bits = bits(128.0 * chroma.x) | bits(128.0 * chroma.y) << 16;
  result[of_result[3] + uint(block.y) * row_words + uint(block.x)] = chroma_doubt ? uint(CHROMA_DOUBT) : chroma_bits;
  any_doubt = any_doubt || chroma_doubt;
#endif
  if (any_lost != 0u || any_doubt) result[of_result[0] + uint(block.y)] = of_result[5];
  if (any_doubt) result[of_result[1] + uint(block.y)] = of_result[5];
}
)";

// The view is blended by its mesh: each pixel by the cameras of the face that owns it.
inline constexpr std::string_view kBlockOfFaces = R"(
// Of a pixel: what its face's cameras weigh in it that see it. Its sum, and lost weight or DOUBT.
vec3 weights_of(ivec2 at, out vec3 sum, out uint lost_bits) {
  vec2 d = from_anchor(at);
  doubt = false;
  vec3 w = weights_at(d);
  float level = level_at(vec2(at + origin)), lost = 0.0;
  sum = vec3(0.0);
  for (int k = 0; k < 3; k++) {
    vec2 position = vec2(0.0);
    int sight = w[k] > 0.0 ? project(k, d, level, false, position) : kSeen;
    doubt = doubt || sight == kUnknown;
    if (sight == kLost) lost += w[k];
    if (sight != kSeen) w[k] = 0.0;
    if (w[k] > 0.0) sum += w[k] * colour_at(k, position);
  }
  sum *= 255.0 * 128.0;
  lost_bits = doubt ? uint(DOUBT) : bits(32768.0 * lost);
  return w;
}

void main() {
  begin_view(gl_WorkGroupID.z);
  ivec2 block = ivec2(gl_GlobalInvocationID.xy), first = 2 * block;
  if (any(greaterThanEqual(first, size))) return;
  int owner[4];
  vec3 sums[4];
  uint lost_of[4];
  for (int n = 0; n < 4; n++) {
    ivec2 at = first + ivec2(n & 1, n >> 1);
    owner[n] = all(lessThan(at, size)) ? face_at(at) : -1;
    sums[n] = vec3(0.0);
    lost_of[n] = 0u;
  }
  vec2 chroma = vec2(0.0);
  bool chroma_doubt = false;
#ifndef RGB
  ivec2 last = min(first + 1, size - 1); // at the view's end there is no other
  float pixels = float((last.x - first.x + 1) * (last.y - first.y + 1));
#endif
  for (int n = 0; n < 4; n++) {
    face_row = owner[n];
    bool is_first = face_row >= 0;
    for (int m = 0; m < n; m++) is_first = is_first && owner[m] != face_row;
    if (!is_first) continue;
    vec3 weights = vec3(0.0);
    for (int m = n; m < 4; m++)
      if (owner[m] == face_row) {
        weights += weights_of(first + ivec2(m & 1, m >> 1), sums[m], lost_of[m]);
#ifndef RGB
        chroma_doubt = chroma_doubt || doubt;
#endif
      }
#ifndef RGB
    // A camera's chroma is sampled in the middle of four pixels and weighs the mean of what it gives to them.
#ifdef RAYS
    vec2 centre = texelFetch(centre_rays, block, 0).xy;
#else
    vec2 centre = vec2(first + last) / 2.0 + vec2(origin) - FACE(0).xy;
#endif
    float level = level_at(vec2(first + origin) + 0.5);
    for (int k = 0; k < 3; k++) {
      if (!(weights[k] > 0.0)) continue;
      vec2 position = vec2(0.0);
      if (project(k, centre, level, true, position) == kSeen)
        chroma += weights[k] / pixels * chroma_at(k, position);
      else
        chroma_doubt = true;
    }
#endif
  }
  write_block(first, sums, lost_of, chroma, chroma_doubt);
}
)";

// The view is blended by a BlendGrid: a pixel that is in focus by all cameras of its cell.
inline constexpr std::string_view kBlockOfCells = R"(
// Of the camera whose words begin there, in a pixel of the cell: BlendGrid::Cell::weight().
int weight_in(uint camera, ivec2 at) {
  int level[2], size = 1 << CELL_BITS;
  for (int i = 0; i < 2; i++) {
    int of[4];
    for (uint p = 0u; p < 4u; p++) of[p] = int((runs[camera + 1u + p] >> (16 * i)) & 0xffffu);
    int left = of[0] * (size - at.y) + of[2] * at.y, right = of[1] * (size - at.y) + of[3] * at.y;
    level[i] = (left * size + (right - left) * at.x + (1 << (2 * CELL_BITS - 1))) >> (2 * CELL_BITS);
  }
  return level[1] - level[0];
}

void main() {
  begin_view(gl_WorkGroupID.z);
  ivec2 first = 2 * ivec2(gl_GlobalInvocationID.xy);
  if (any(greaterThanEqual(first, size))) return;
  ivec2 last = min(first + 1, size - 1); // at the view's end there is no other
  float pixels = float((last.x - first.x + 1) * (last.y - first.y + 1));
  bool in_focus[4], is_open[4];
  vec3 sums[4];
  int lost[4];
  for (int n = 0; n < 4; n++) {
    ivec2 at = first + ivec2(n & 1, n >> 1);
    in_focus[n] = all(lessThan(at, size)) && face_at(at) >= 0;
    is_open[n] = false;
    sums[n] = vec3(0.0);
    lost[n] = 0;
  }
  vec2 chroma = vec2(0.0);
  bool chroma_doubt = false;
  ivec2 first_cell = origin >> CELL_BITS, cell = ((first + origin) >> CELL_BITS) - first_cell,
        all_cells = ((origin + size - 1) >> CELL_BITS) - first_cell + 1;
  uint entry = cells + uint(cell.y * all_cells.x + cell.x), cameras = cells + uint(all_cells.x * all_cells.y) + 1u;
  for (uint c = runs[entry]; c < runs[entry + 1u]; c++) {
    uint camera = cameras + uint(CELL_WORDS) * c;
    face_row = first_face + int(runs[camera]);
    float seen = 0.0;
    for (int n = 0; n < 4; n++) {
      ivec2 at = first + ivec2(n & 1, n >> 1);
      int weight = in_focus[n] ? weight_in(camera, (at + origin) & ((1 << CELL_BITS) - 1)) : 0;
      if (weight == 0) continue;
      vec2 position = vec2(0.0);
      int sight = project(0, from_anchor(at), level_at(vec2(at + origin)), false, position);
      if (sight == kUnknown) is_open[n] = chroma_doubt = true;
      if (sight == kLost) lost[n] += weight;
      if (sight != kSeen) continue;
      sums[n] += float(weight) * colour_at(0, position);
      seen += float(weight);
    }
#ifndef RGB
    if (!(seen > 0.0)) continue;
#ifdef RAYS
    vec2 centre = texelFetch(centre_rays, first / 2, 0).xy;
#else
    vec2 centre = vec2(first + last) / 2.0 + vec2(origin) - FACE(0).xy;
#endif
    vec2 position = vec2(0.0);
    if (project(0, centre, level_at(vec2(first + origin) + 0.5), true, position) == kSeen)
      chroma += seen / float(WEIGHT_ONE) / pixels * chroma_at(0, position);
    else
      chroma_doubt = true;
#endif
  }
  uint lost_of[4];
  for (int n = 0; n < 4; n++) {
    sums[n] *= 255.0 * 128.0 / float(WEIGHT_ONE);
    lost_of[n] = is_open[n] ? uint(DOUBT) : uint(lost[n]);
  }
  write_block(first, sums, lost_of, chroma, chroma_doubt);
}
)";

}  // namespace lf::gl
