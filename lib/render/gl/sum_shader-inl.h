// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <string_view>

// Sources of the compute shaders for sums and photo-consistency sums. compute_shader() combines them, after a header
// that defines the constants in capitals.
//
// The shaders compute in float. If CAREFUL is defined, they also compute a bound of the rounding error. If the bound is
// too large, the sample is undecided: the variable `undecided` becomes true, and the shader writes UNDECIDED
// (kUndecided) as missing weight, or CHROMA_UNDECIDED (kChromaUndecided) as chroma. The CPU then computes the sample in
// double precision (see cpu_fixup()).
namespace lf::gl {

// The rendering rule of docs/architecture.md, which all shaders share: weights in a face, projection into a camera, and
// bilinear samples.
inline constexpr std::string_view kRule = R"(
precision highp float;
precision highp int;
uniform highp usampler2D levels;     // levels of map nodes; the maps of all views are stacked vertically
uniform highp sampler2D rays;        // distorted views: lines of sight of pixels
uniform highp sampler2D centre_rays; // distorted views: lines of sight of the centres of 2x2 blocks

// Variables of the view, set by begin_view(), and of the face.
ivec2 nodes;         // columns and rows of the focal map
int first_level_row; // first row of the map in `levels`
layout(std430, binding = TABLES) readonly buffer Tables { vec4 tables[]; };
int face_row; // table row of the current face
#define FACE(texel) tables[face_row * FACE_TEXELS + texel]
ivec2 origin;   // first pixel of the sum, in the view
ivec2 size;     // width and height of the sum, pixels
vec4 map_scale; // MapScale: pixels per node; inverse distance of level 0, and per level; eye distance
vec4 edge(int k) { return FACE(FACE_EDGE + k); }
vec4 corner(int k, int texel) { return FACE(FACE_CORNERS + k * CORNER_TEXELS + texel); }

bool undecided = false;

// Returns the weights of the face's cameras, 0 for remote cameras. `d`: see from_anchor().
vec3 weights_at(vec2 d) {
  vec3 e, is_local;
  float terms = 0.0;
  for (int k = 0; k < 3; k++) {
    vec3 products = vec3(edge(k).xy * d, edge(k).z);
    e[k] = products.x + (products.y + products.z);
    is_local[k] = edge(k).w;
#ifdef CAREFUL
    terms += dot(abs(products), vec3(1.0));
#endif
  }
  float sum = e.x + e.y + e.z;
#ifdef CAREFUL
  undecided = undecided || !(terms * FLOAT_ROUNDING < MAX_WEIGHT_ERROR * abs(sum));
#endif
  return clamp(e / sum, 0.0, 1.0) * is_local;
}

// Interpolates 2x2 texels in the order of textureGather(): (0, 1), (1, 1), (1, 0), (0, 0). The gather coordinate must
// be the corner that the texels share: (x + 1, y + 1) / size for the upper left texel (x, y).
float bilinear(vec4 gathered, vec2 fraction) {
  vec2 column = mix(gathered.wx, gathered.zy, fraction.x);
  return mix(column.x, column.y, fraction.y);
}

#ifdef MAP
// Interpolates the map at a pixel of the view. The level is relative to the face's anchor.
float level_at(vec2 pixel) {
  vec2 at = clamp((pixel + 0.5) / map_scale.x - 0.5, vec2(0.0), vec2(nodes - 1));
  ivec2 cell = min(ivec2(at), max(nodes - 2, 0));
  ivec2 corner = cell + ivec2(1, 1 + first_level_row);
  vec4 texels = vec4(textureGather(levels, vec2(corner) / vec2(textureSize(levels, 0))));
  return bilinear(texels, at - vec2(cell)) - FACE(0).w;
}
#else
float level_at(vec2 pixel) { return 0.0; }
#endif

// Returns the point in the coordinates of camera k, up to a positive factor. `inverse_distance`:
// relative to the face's anchor.
vec3 camera_point(int k, vec2 d, float inverse_distance) {
  vec3 x = corner(k, CORNER_FROM).xyz + (d.x * corner(k, CORNER_ALONG).xyz + d.y * corner(k, CORNER_DOWN).xyz);
#ifdef MAP
  x += inverse_distance * (corner(k, CORNER_PER_FROM).xyz +
                 (d.x * corner(k, CORNER_PER_ALONG).xyz + d.y * corner(k, CORNER_PER_DOWN).xyz));
#endif
  return x;
}

#ifdef GENERAL
bool is_fisheye(int k) { return corner(k, CORNER_PRISM).w != 0.0; }

// Returns (a, b) and tan^2 of half the angle from the axis; see through_lens() in distort-inl.h.
vec3 by_angle(vec3 x) {
  float distance = sqrt(dot(x, x)), h = 2.0 / max(distance + x.z, 1e-6 * distance);
  float w = 1.0 - x.z * h, t = 1.67932564 * w - 1.0;
  float sum = 2.8127337e-5;
  sum = sum * t - 8.4596728e-5;
  sum = sum * t + 1.9516860e-4;
  sum = sum * t - 6.1583603e-4;
  sum = sum * t + 2.0542805e-3;
  sum = sum * t - 7.0056023e-3;
  sum = sum * t + 2.5863107e-2;
  sum = sum * t - 0.11246027;
  sum = sum * t + 0.85169296;
  return vec3(h * sum * x.xy, w);
}
#else
bool is_fisheye(int k) { return false; }
vec3 by_angle(vec3 x) { return x; }
#endif

// Returns (a, b) of a point and the value that must not exceed the limit of the lens; see Distortion.
vec3 undistorted(int k, vec3 x) {
  if (is_fisheye(k)) return by_angle(x);
  vec2 u = x.xy / x.z;
  return vec3(u, dot(u, u));
}

// Returns the position in the image for (a, b).
vec2 image_position(int k, vec2 u) {
  vec4 lens = corner(k, CORNER_LENS);
#ifdef GENERAL
  vec4 b = corner(k, CORNER_DISTORTION), g = corner(k, CORNER_GENERAL), prism = corner(k, CORNER_PRISM);
  float q = dot(u, u);
  float radial = (1.0 + q * (b.x + q * (b.y + q * (g.x + q * g.y)))) / (1.0 + q * (g.z + q * (g.w + q * prism.x)));
  u = u * radial + 2.0 * u.x * u.y * b.zw + b.wz * (q + 2.0 * u * u) + q * prism.yz;
#elif defined(DISTORTED)
  vec4 b = corner(k, CORNER_DISTORTION);
  float r2 = dot(u, u);
  u = u * (1.0 + r2 * (b.x + r2 * b.y)) + 2.0 * u.x * u.y * b.zw + b.wz * (r2 + 2.0 * u * u);
#endif
  return lens.xy * u + lens.zw;
}

#ifdef CAREFUL
const int kInvisible = 0, kVisible = 1, kUnknown = 2;

// Projects the point in focus into camera k. kInvisible: the camera does not see the point. kUnknown: float cannot
// decide, or the error of `position` may exceed MAX_POSITION_ERROR. `allow_outside`: positions outside the image are
// valid as well.
int project(int k, vec2 d, float level, bool allow_outside, out vec2 position) {
  position = vec2(0.0);
  if ((int(corner(k, CORNER_ALONG).w) & HAS_IMAGE) == 0) return kInvisible;
  vec3 terms = abs(corner(k, CORNER_FROM).xyz) + abs(d.x * corner(k, CORNER_ALONG).xyz) +
               abs(d.y * corner(k, CORNER_DOWN).xyz);
  float inverse_distance = 0.0;
#ifdef MAP
  inverse_distance = level * map_scale.z;
  float eye = (map_scale.y + (level + FACE(0).w) * map_scale.z) * map_scale.w;
  if (abs(1.0 - eye) <= EYE_MARGIN * (1.0 + abs(eye))) return kUnknown;
  if (eye > 1.0) return kInvisible; // the surface is behind the eye
  terms += abs(inverse_distance) * (abs(corner(k, CORNER_PER_FROM).xyz) + abs(d.x * corner(k, CORNER_PER_ALONG).xyz) +
                          abs(d.y * corner(k, CORNER_PER_DOWN).xyz));
#endif
  vec3 x = camera_point(k, d, inverse_distance), rounding = FLOAT_ROUNDING * terms;
  vec3 u = undistorted(k, x);
  vec2 error = (rounding.xy + abs(u.xy) * rounding.z) / x.z;
  float near = 2.0 * dot(abs(u.xy), error); // error of u.z
  if (is_fisheye(k)) {
    float distance = sqrt(dot(x, x));
    if (!(distance > 4.0 * length(rounding))) return kUnknown;
    // The depth moves the direction in proportion to the sine of the angle from the axis. (a, b) moves at most 1.67
    // times as far as the direction.
    error = vec2(1.67 * (length(rounding.xy) + rounding.z * length(x.xy) / distance) / distance, 0.0);
    near = (1.0 + u.z) * sqrt(u.z) * length(rounding) / distance;
  } else if (!(x.z > rounding.z)) {
    return x.z < -rounding.z ? kInvisible : kUnknown;
  }
  vec4 lens = corner(k, CORNER_LENS), image = corner(k, CORNER_IMAGE);
  float rounding_of_lens = 1.0;
#ifdef DISTORTED
  // A camera without distortion has an unlimited u.z, and its bounds are 1.
  near += 4e-6 * image.z;
  if (u.z - near > image.z) return kInvisible;
  if (!(u.z + near < image.z)) return kUnknown;
  vec4 b = corner(k, CORNER_DISTORTION);
  float growth = 1.0 + 3.0 * abs(b.x) * u.z + 5.0 * abs(b.y) * u.z * u.z + 6.0 * (abs(b.z) + abs(b.w)) * sqrt(u.z);
#ifdef GENERAL
  vec4 steepness = corner(k, CORNER_STEEPNESS);
  if (steepness.z != 0.0) {
    error = vec2(length(error));
    growth = steepness.x;
    rounding_of_lens = 1.0 + steepness.y;
  }
#endif
  error *= growth;
#endif
  position = image_position(k, u.xy);
  error = lens.xy * error + 2e-7 * (rounding_of_lens * abs(position - lens.zw) + abs(lens.zw));
  vec2 last = image.xy - 0.5;
  if (!allow_outside) {
    if (any(lessThan(position + error, vec2(-0.5))) || any(greaterThan(position - error, last))) return kInvisible;
    if (!(all(greaterThan(position - error, vec2(-0.5))) && all(lessThan(position + error, last)))) return kUnknown;
  }
  return max(error.x, error.y) < MAX_POSITION_ERROR ? kVisible : kUnknown;
}
#endif

// Returns the upper left of the four pixels to interpolate, and reduces `position` to the fraction. Positions
// beyond the centres of the outer pixels are clamped.
ivec2 upper_left_pixel(inout vec2 position, vec2 image_size) {
#ifdef CAREFUL
  position = clamp(position, vec2(0.0), image_size - 1.0);
  ivec2 first = min(ivec2(position), max(ivec2(image_size) - 2, ivec2(0)));
#else
  ivec2 first = ivec2(position);
#endif
  position -= vec2(first);
  return first;
}

// Returns the offset of the camera's image (kI420: its luma) in the atlas.
ivec2 atlas_offset(int k) { return ivec2(corner(k, CORNER_FROM).w, corner(k, CORNER_IMAGE).w); }

// Clamps, because branch-free code may fetch texels at arbitrary positions for cameras that do not see the point.
#ifdef CAREFUL
#define IN_ATLAS(at) clamp(at, ivec2(0), textureSize(images, 0) - 1)
#else
#define IN_ATLAS(at) (at)
#endif

uniform highp sampler2D images; // the atlas
uniform ivec4 chroma_places;    // kI420: offsets of Cb and Cr in the atlas

// Bilinear samples, 0 to 1. `offset`: offset of the image in the atlas.
#define TEXEL(at) texelFetch(images, IN_ATLAS(offset + (at)), 0)
#ifdef RGB
vec3 rgb_of(int k, vec4 bytes) {
  int order = int(corner(k, CORNER_DOWN).w);
  return vec3(bytes[order & 3], bytes[(order >> 2) & 3], bytes[order >> 4]);
}
vec3 colour_at(int k, vec2 position) {
  ivec2 offset = atlas_offset(k), first = upper_left_pixel(position, corner(k, CORNER_IMAGE).xy);
  vec3 upper = mix(rgb_of(k, TEXEL(first)), rgb_of(k, TEXEL(first + ivec2(1, 0))), position.x);
  vec3 lower = mix(rgb_of(k, TEXEL(first + ivec2(0, 1))), rgb_of(k, TEXEL(first + 1)), position.x);
  return mix(upper, lower, position.y);
}
#else
float sampled_byte(ivec2 offset, vec2 image_size, vec2 position) {
  ivec2 first = upper_left_pixel(position, image_size);
  return bilinear(textureGather(images, vec2(offset + first + 1) / vec2(textureSize(images, 0))), position);
}
vec3 colour_at(int k, vec2 position) {
  return vec3(sampled_byte(atlas_offset(k), corner(k, CORNER_IMAGE).xy, position));
}
// Returns Cb and Cr in levels, with grey = 0. `position`: in the luma image.
vec2 chroma_at(int k, vec2 position) {
  vec2 image_size = floor((corner(k, CORNER_IMAGE).xy + 1.0) / 2.0);
  ivec2 offset = atlas_offset(k) / 2;
  position = (position - 0.5) / 2.0;
  return 255.0 * vec2(sampled_byte(offset + chroma_places.xy, image_size, position),
                      sampled_byte(offset + chroma_places.zw, image_size, position)) - 128.0;
}
#endif

uint bits(float value) { return uint(int(floor(value + 0.5))) & 0xffffu; }
)";

// Appended to kRule: selects the view of the pass, and finds the face that owns a pixel.
inline constexpr std::string_view kRuns = R"(
layout(local_size_x = GROUP, local_size_y = GROUP) in;

// First the ViewWords of all views of the pass. Then for each view: the index of the first run of each row of the sum,
// and the number of runs; then two words per run: x0 in the low and x1 in the high 16 bits, and the face.
layout(std430, binding = RUNS) readonly buffer Runs { uint runs[]; };
uint first_row;    // index in `runs` of the view's first row
int first_face;    // table row of the view's first face
uint result_layout[6]; // location of the view's sum: kViewResult
uint cells;        // index in `runs` of the view's first cell
int first_slot;    // table row of the view's first slot, after its last face; only with cells

void begin_view(uint view) {
  uint head = VIEW_WORDS * view;
  origin = ivec2(runs[head + VIEW_ORIGIN], runs[head + VIEW_ORIGIN + 1u]);
  size = ivec2(runs[head + VIEW_SIZE], runs[head + VIEW_SIZE + 1u]);
  first_row = runs[head + VIEW_RUNS];
  first_face = int(runs[head + VIEW_FACES]);
  first_level_row = int(runs[head + VIEW_LEVELS]);
  nodes = ivec2(runs[head + VIEW_NODES], runs[head + VIEW_NODES + 1u]);
  for (uint i = 0u; i < 4u; i++) map_scale[i] = uintBitsToFloat(runs[head + VIEW_SCALE + i]);
  for (uint i = 0u; i < 6u; i++) result_layout[i] = runs[head + VIEW_RESULT + i];
  cells = runs[head + VIEW_CELLS];
  first_slot = int(runs[head + VIEW_SLOTS]);
}

// Returns the table row of the face that owns a pixel of the sum; -1: no face with a local camera.
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

// Returns the position of a pixel of the sum relative to the anchor of face_row; with RAYS its line of sight.
vec2 from_anchor(ivec2 at) {
#ifdef RAYS
  return texelFetch(rays, at, 0).xy;
#else
  return vec2(at + origin) - FACE(0).xy;
#endif
}
)";

// Appended to kRule and kRuns in the shader of BlockSums: writes the sum of a block. An invocation computes 2x2 pixels
// and their chroma. In write_block(), `sums` are in units of 1/128 level, `chroma` in levels, and `missing_bits` is
// the missing weight in units of 1/32768 or UNDECIDED.
inline constexpr std::string_view kBlocks = R"(
// The sums of all views, with the layout of BlockSum::Parts at the offsets in result_layout. missing_rows has the
// number of the draw if a row of blocks has missing weight or undecided samples, undecided_rows if it has undecided
// samples. Other values in these two parts are stale. The samples are as in ReadbackBuffer, two per word.
layout(std430, binding = RESULT) writeonly buffer Result { uint result[]; };

// `first`: first pixel of the block. `sums`: in units of 1/128 level. `missing_bits`: 32768 = weight 1, or UNDECIDED.
// `chroma`: in levels.
void write_block(ivec2 first, vec3 sums[4], uint missing_bits[4], vec2 chroma, bool chroma_undecided) {
  ivec2 block = first / 2;
  uint row_words = uint(size.x + 1) / 2u;
  uint any_missing = 0u;
  bool any_undecided = false;
  for (int j = 0; j < 2; j++) {
    int y = first.y + j, left = 2 * j;
    if (y >= size.y) break;
    uint word = uint(y) * row_words + uint(block.x);
#ifdef RGB
    for (int i = 0; i < 2; i++) {
      vec3 sum = sums[left + i];
      uint at = result_layout[2] + 4u * word + 2u * uint(i);
      result[at] = bits(sum.r) | bits(sum.g) << 16;
      result[at + 1u] = bits(sum.b);
    }
#else
    result[result_layout[2] + word] = bits(sums[left].x) | bits(sums[left + 1].x) << 16;
#endif
    result[result_layout[4] + word] = missing_bits[left] | missing_bits[left + 1] << 16;
    any_missing |= missing_bits[left] | missing_bits[left + 1];
    for (int i = 0; i < 2; i++) any_undecided = any_undecided || missing_bits[left + i] == uint(UNDECIDED);
  }
#ifndef RGB
  uint chroma_bits = bits(128.0 * chroma.x) | bits(128.0 * chroma.y) << 16;
  if (chroma_undecided) chroma_bits = uint(CHROMA_UNDECIDED);
  result[result_layout[3] + uint(block.y) * row_words + uint(block.x)] = chroma_bits;
  any_undecided = any_undecided || chroma_undecided;
#endif
  if (any_missing != 0u || any_undecided) result[result_layout[0] + uint(block.y)] = result_layout[5];
  if (any_undecided) result[result_layout[1] + uint(block.y)] = result_layout[5];
}
)";

// Renders the pixels of views, or parts of views, that take their weights from a WeightGrid. Any number of cameras can
// contribute to a pixel. The argument `camera` of weight_in() is the position in the buffer `runs` of the kCellWords
// words that describe a camera in the cell. The result is the camera's weight in pixel `at` of the cell, in units of
// 1/32768.
inline constexpr std::string_view kBlockOfCells = R"(
#ifdef CELLS
// WeightGrid::Cell::weight() of a camera in pixel `at` of the cell. `camera`: index of the camera's words in `runs`.
int weight_in(uint camera, ivec2 at) {
  int level[2], size = 1 << CELL_BITS;
  for (int i = 0; i < 2; i++) {
    int corners[4];
    for (uint p = 0u; p < 4u; p++) corners[p] = int((runs[camera + 1u + p] >> (16 * i)) & 0xffffu);
    int left = corners[0] * (size - at.y) + corners[2] * at.y;
    int right = corners[1] * (size - at.y) + corners[3] * at.y;
    level[i] = (left * size + (right - left) * at.x + (1 << (2 * CELL_BITS - 1))) >> (2 * CELL_BITS);
  }
  return level[1] - level[0];
}

// Sets the sums and the missing weights of the pixels in `in_cells`, and adds the block's chroma.
void add_cells(ivec2 first, bool in_cells[4], inout vec3 sums[4], inout uint missing_bits[4], inout vec2 chroma,
               inout bool chroma_undecided) {
  ivec2 last = min(first + 1, size - 1); // the block may extend beyond the view
  float pixels = float((last.x - first.x + 1) * (last.y - first.y + 1));
  bool is_undecided[4];
  int missing[4];
  for (int n = 0; n < 4; n++) {
    is_undecided[n] = false;
    missing[n] = 0;
  }
  ivec2 first_cell = origin >> CELL_BITS, cell = ((first + origin) >> CELL_BITS) - first_cell,
        all_cells = ((origin + size - 1) >> CELL_BITS) - first_cell + 1;
  uint entry = cells + uint(cell.y * all_cells.x + cell.x), cameras = cells + uint(all_cells.x * all_cells.y) + 1u;
  for (uint c = runs[entry]; c < runs[entry + 1u]; c++) {
    uint camera = cameras + uint(CELL_WORDS) * c;
    face_row = first_slot + int(runs[camera]);
    float visible_weight = 0.0;
    for (int n = 0; n < 4; n++) {
      ivec2 at = first + ivec2(n & 1, n >> 1);
      int weight = in_cells[n] ? weight_in(camera, (at + origin) & ((1 << CELL_BITS) - 1)) : 0;
      if (weight == 0) continue;
      vec2 position = vec2(0.0);
      int visibility = project(0, from_anchor(at), level_at(vec2(at + origin)), false, position);
      if (visibility == kUnknown) is_undecided[n] = chroma_undecided = true;
      if (visibility == kInvisible) missing[n] += weight;
      if (visibility != kVisible) continue;
      sums[n] += float(weight) * colour_at(0, position);
      visible_weight += float(weight);
    }
#ifndef RGB
    if (!(visible_weight > 0.0)) continue;
#ifdef RAYS
    vec2 centre = texelFetch(centre_rays, first / 2, 0).xy;
#else
    vec2 centre = vec2(first + last) / 2.0 + vec2(origin) - FACE(0).xy;
#endif
    vec2 position = vec2(0.0);
    if (project(0, centre, level_at(vec2(first + origin) + 0.5), true, position) == kVisible)
      chroma += visible_weight / float(WEIGHT_ONE) / pixels * chroma_at(0, position);
    else
      chroma_undecided = true;
#endif
  }
  for (int n = 0; n < 4; n++) {
    if (!in_cells[n]) continue;
    sums[n] *= 255.0 * 128.0 / float(WEIGHT_ONE);
    missing_bits[n] = is_undecided[n] ? uint(UNDECIDED) : uint(missing[n]);
  }
}
#endif
)";

// Renders the pixels of the mesh. Each pixel is blended from the cameras at the corners of the face that owns the
// pixel.
inline constexpr std::string_view kBlockOfFaces = R"(
// Computes the sum of a pixel and its missing weight or UNDECIDED. Returns the weights of the face's cameras, 0 for
// cameras that do not see the pixel.
vec3 blend_pixel(ivec2 at, out vec3 sum, out uint missing_bits) {
  vec2 d = from_anchor(at);
  undecided = false;
  vec3 w = weights_at(d);
  float level = level_at(vec2(at + origin)), missing = 0.0;
  sum = vec3(0.0);
  for (int k = 0; k < 3; k++) {
    vec2 position = vec2(0.0);
    int visibility = w[k] > 0.0 ? project(k, d, level, false, position) : kVisible;
    undecided = undecided || visibility == kUnknown;
    if (visibility == kInvisible) missing += w[k];
    if (visibility != kVisible) w[k] = 0.0;
    if (w[k] > 0.0) sum += w[k] * colour_at(k, position);
  }
  sum *= 255.0 * 128.0;
  missing_bits = undecided ? uint(UNDECIDED) : bits(32768.0 * missing);
  return w;
}

void main() {
  begin_view(gl_WorkGroupID.z);
  ivec2 block = ivec2(gl_GlobalInvocationID.xy), first = 2 * block;
  if (any(greaterThanEqual(first, size))) return;
  int owner[4];
  vec3 sums[4];
  uint missing_bits[4];
  for (int n = 0; n < 4; n++) {
    ivec2 at = first + ivec2(n & 1, n >> 1);
    owner[n] = all(lessThan(at, size)) ? face_at(at) : -1;
    sums[n] = vec3(0.0);
    missing_bits[n] = 0u;
  }
#ifdef CELLS
  bool in_cells[4];
  for (int n = 0; n < 4; n++) {
    in_cells[n] = owner[n] == first_slot - 1;
    if (in_cells[n]) owner[n] = -1;
  }
#endif
  vec2 chroma = vec2(0.0);
  bool chroma_undecided = false;
#ifndef RGB
  ivec2 last = min(first + 1, size - 1); // the block may extend beyond the view
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
        weights += blend_pixel(first + ivec2(m & 1, m >> 1), sums[m], missing_bits[m]);
#ifndef RGB
        chroma_undecided = chroma_undecided || undecided;
#endif
      }
#ifndef RGB
    // Sample a camera's chroma at the centre of the block. Its weight is the camera's mean weight in the four pixels.
#ifdef RAYS
    vec2 centre = texelFetch(centre_rays, block, 0).xy;
#else
    vec2 centre = vec2(first + last) / 2.0 + vec2(origin) - FACE(0).xy;
#endif
    float level = level_at(vec2(first + origin) + 0.5);
    for (int k = 0; k < 3; k++) {
      if (!(weights[k] > 0.0)) continue;
      vec2 position = vec2(0.0);
      if (project(k, centre, level, true, position) == kVisible)
        chroma += weights[k] / pixels * chroma_at(k, position);
      else
        chroma_undecided = true;
    }
#endif
  }
#ifdef CELLS
  add_cells(first, in_cells, sums, missing_bits, chroma, chroma_undecided);
#endif
  write_block(first, sums, missing_bits, chroma, chroma_undecided);
}
)";

// Appended to kRule and kRuns in the shader of ConsistencySums: tests depth hypotheses. An invocation computes the sums
// of two adjacent nodes of the map through one hypothesis (called a surface here).
inline constexpr std::string_view kConsistency = R"(
// Levels of the nodes for each surface, four per word. Each row begins at a whole word.
layout(std430, binding = SURFACES) readonly buffer Surfaces { uint surfaces[]; };
// Planes of weight, luma and square (see PhotoConsistency) for each surface, two nodes per word.
layout(std430, binding = RESULT) writeonly buffer Result { uint result[]; };

uint level_of(int surface, ivec2 at) {
  int word = (surface * size.y + at.y) * ((size.x + 3) / 4) + at.x / 4;
  return (surfaces[word] >> uint(8 * (at.x & 3))) & 255u;
}

// Projects a node into camera k. Returns true if the camera sees the node.
bool sees(int k, vec2 d, float level, out vec2 position) {
  vec3 x = camera_point(k, d, (level - FACE(0).w) * map_scale.z);
  vec3 u = undistorted(k, x);
  vec4 image = corner(k, CORNER_IMAGE);
  position = image_position(k, u.xy);
  bool is_before_eye = (x.z > 0.0 || is_fisheye(k)) && (map_scale.y + level * map_scale.z) * map_scale.w < 1.0;
  bool seen = is_before_eye && (int(corner(k, CORNER_ALONG).w) & HAS_IMAGE) != 0;
#ifdef DISTORTED
  seen = seen && u.z <= image.z;
#endif
  return seen && all(greaterThanEqual(position, vec2(-0.5))) && all(lessThanEqual(position, image.xy - 0.5));
}

// Returns luma in levels. Pixels outside the image are clamped to its edge.
int luma_at(int k, ivec2 pixel) {
  ivec2 last = ivec2(corner(k, CORNER_IMAGE).xy) - 1;
  ivec2 at = atlas_offset(k) + clamp(pixel, ivec2(0), last);
  vec4 bytes = texelFetch(images, clamp(at, ivec2(0), textureSize(images, 0) - 1), 0);
#ifdef RGB
  ivec3 rgb = ivec3(255.0 * rgb_of(k, bytes) + 0.5);
  return (77 * rgb.r + 150 * rgb.g + 29 * rgb.b + 128) >> 8;
#else
  return int(255.0 * bytes.r + 0.5);
#endif
}

// Returns the rounded means of 4x4 boxes around the lower right corners of four pixels: `at`, and its right, lower and
// lower right neighbours.
ivec4 means_of_4x4_boxes(int k, ivec2 at) {
  ivec4 sums = ivec4(8);
  for (int j = -1; j < 4; j++) {
    int middle = luma_at(k, at + ivec2(0, j)) + luma_at(k, at + ivec2(1, j)) + luma_at(k, at + ivec2(2, j));
    ivec2 row = middle + ivec2(luma_at(k, at + ivec2(-1, j)), luma_at(k, at + ivec2(3, j)));
    if (j < 3) sums.xy += row;
    if (j > -1) sums.zw += row;
  }
  return sums >> 4;
}

// Returns the means of boxes with a side of `box` pixels around the same corners as means_of_4x4_boxes(). The mean of a
// box larger than 4x4 is the rounded mean of its quarters. The loop visits the 4x4 boxes in Z-order and finishes each
// larger box after its last quarter.
ivec4 means_of_boxes(int k, ivec2 at, int box) {
  ivec4 sums[3] = ivec4[3](ivec4(0), ivec4(0), ivec4(0)), means = ivec4(0);
  for (int n = 0; n < box * box / 16; n++) {
    ivec2 centre = at;
    for (int m = 0; 8 << m <= box; m++) centre += (2 << m) * (2 * ivec2(n >> (2 * m) & 1, n >> (2 * m + 1) & 1) - 1);
    means = means_of_4x4_boxes(k, centre);
    for (int m = 0; 8 << m <= box; m++) {
      sums[m] += means;
      if ((n >> (2 * m) & 3) != 3) break;
      means = (sums[m] + 2) >> 2;
      sums[m] = ivec4(0);
    }
  }
  return means;
}

// Returns luma at a position in camera k's image, rounded to a level. Interpolates between four boxes, with the
// position in 1/256 pixel.
uint sampled_luma(int k, vec2 position) {
  ivec2 at = ivec2(256.0 * clamp(position - 0.5, vec2(0.0), corner(k, CORNER_IMAGE).xy - 1.0));
  ivec4 means = means_of_boxes(k, at >> 8, int(corner(k, CORNER_PER_FROM).w));
  ivec2 fraction = at & 255, sides = means.xz * (256 - fraction.x) + means.yw * fraction.x;
  return uint((sides.x * (256 - fraction.y) + sides.y * fraction.y + (1 << 15)) >> 16);
}

// Returns the sums of weight, luma and square over a node's cameras.
uvec3 consistency_of(vec3 weights, vec2 d, float level) {
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
    pair |= consistency_of(weights_at(d), d, float(level_of(surface, at))) << (16 * n);
  }
  uint row_words = uint(size.x + 1) / 2u, plane = row_words * uint(size.y);
  uint word = uint(first.y) * row_words + uint(first.x) / 2u;
  for (int m = 0; m < 3; m++) result[uint(3 * surface + m) * plane + word] = pair[m];
}
)";

}  // namespace lf::gl
