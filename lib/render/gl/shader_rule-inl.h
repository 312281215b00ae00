// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <string_view>

namespace lf::gl {

// The rule of docs/design.md, if careful with bounds of what float adds to it.
inline constexpr std::string_view kRule = R"(
precision highp float;
precision highp int;
uniform highp usampler2D levels;     // of focal maps' nodes: of all views of a pass, one map below the other
uniform highp sampler2D rays;        // of distorted views: lines of sight of pixels,
uniform highp sampler2D centre_rays; // and of the middle of four

// begin_view() sets what is of a view.
ivec2 nodes;         // of the focal map
int first_level_row; // where they begin in `levels`
layout(std430, binding = TABLES) readonly buffer Tables { vec4 tables[]; };
int face_row; // of the face that is looked at now
#define FACE(texel) tables[face_row * FACE_TEXELS + texel]
ivec2 origin;   // the sum's first pixel in the view
ivec2 size;     // the sum's width and height, pixels
vec4 map_scale; // the step of nodes, pixels; inverse distance of level 0, of a level more; eye distance
vec4 edge(int k) { return FACE(FACE_EDGE + k); }
vec4 corner(int k, int texel) { return FACE(FACE_CORNERS + k * CORNER_TEXELS + texel); }

bool doubt = false;

// Of the face's cameras, 0 for those of others. `d`: from the anchor.
vec3 weights_at(vec2 d) {
  vec3 e, ours;
  float terms = 0.0;
  for (int k = 0; k < 3; k++) {
    vec3 part = vec3(edge(k).xy * d, edge(k).z);
    e[k] = part.x + (part.y + part.z);
    ours[k] = edge(k).w;
#ifdef CAREFUL
    terms += dot(abs(part), vec3(1.0));
#endif
  }
  float sum = e.x + e.y + e.z;
#ifdef CAREFUL
  doubt = doubt || !(terms * FLOAT_ROUNDING < MAX_WEIGHT_ERROR * abs(sum));
#endif
  return clamp(e / sum, 0.0, 1.0) * ours;
}

// Of what textureGather() has of four neighbours: (0, 1), (1, 1), (1, 0) and (0, 0), if it is asked for what is between
// them, from a texture's pixel (1, 1) / size on.
float bilinear(vec4 gathered, vec2 part) {
  vec2 column = mix(gathered.wx, gathered.zy, part.x);
  return mix(column.x, column.y, part.y);
}

#ifdef MAP
// From the face's level.
float level_at(vec2 pixel) {
  vec2 at = clamp((pixel + 0.5) / map_scale.x - 0.5, vec2(0.0), vec2(nodes - 1));
  ivec2 cell = min(ivec2(at), max(nodes - 2, 0));
  ivec2 corner = cell + ivec2(1, 1 + first_level_row);
  vec4 around = vec4(textureGather(levels, vec2(corner) / vec2(textureSize(levels, 0))));
  return bilinear(around, at - vec2(cell)) - FACE(0).w;
}
#else
float level_at(vec2 pixel) { return 0.0; }
#endif

// In camera k, up to a positive factor.
vec3 camera_point(int k, vec2 d, float nearer) {
  vec3 x = corner(k, CORNER_FROM).xyz + (d.x * corner(k, CORNER_ALONG).xyz + d.y * corner(k, CORNER_DOWN).xyz);
#ifdef MAP
  x += nearer * (corner(k, CORNER_PER_FROM).xyz +
                 (d.x * corner(k, CORNER_PER_ALONG).xyz + d.y * corner(k, CORNER_PER_DOWN).xyz));
#endif
  return x;
}

vec2 through_lens(int k, vec2 u) {
  vec4 lens = corner(k, CORNER_LENS);
#ifdef DISTORTED
  vec4 b = corner(k, CORNER_DISTORTION);
  float r2 = dot(u, u);
  u = u * (1.0 + r2 * (b.x + r2 * b.y)) + 2.0 * u.x * u.y * b.zw + b.wz * (r2 + 2.0 * u * u);
#endif
  return lens.xy * u + lens.zw;
}

#ifdef CAREFUL
const int kLost = 0, kSeen = 1, kUnknown = 2;

// Where camera k's image has what is in focus, and whether it does; `beyond`: whether places outside of the image are
// good, too.
int project(int k, vec2 d, float level, bool beyond, out vec2 position) {
  position = vec2(0.0);
  if ((int(corner(k, CORNER_ALONG).w) & HAS_IMAGE) == 0) return kLost;
  vec3 terms = abs(corner(k, CORNER_FROM).xyz) + abs(d.x * corner(k, CORNER_ALONG).xyz) +
               abs(d.y * corner(k, CORNER_DOWN).xyz);
  float nearer = 0.0;
#ifdef MAP
  nearer = level * map_scale.z;
  float eye = (map_scale.y + (level + FACE(0).w) * map_scale.z) * map_scale.w;
  if (abs(1.0 - eye) <= EYE_DOUBT * (1.0 + abs(eye))) return kUnknown;
  if (eye > 1.0) return kLost; // the surface is behind the eye
  terms += abs(nearer) * (abs(corner(k, CORNER_PER_FROM).xyz) + abs(d.x * corner(k, CORNER_PER_ALONG).xyz) +
                          abs(d.y * corner(k, CORNER_PER_DOWN).xyz));
#endif
  vec3 x = camera_point(k, d, nearer), rounding = FLOAT_ROUNDING * terms;
  if (!(x.z > rounding.z)) return x.z < -rounding.z ? kLost : kUnknown;
  vec2 u = x.xy / x.z, off = (rounding.xy + abs(u) * rounding.z) / x.z;
  vec4 lens = corner(k, CORNER_LENS), image = corner(k, CORNER_IMAGE);
#ifdef DISTORTED
  vec4 b = corner(k, CORNER_DISTORTION);
  if (b != vec4(0.0)) {
    float r2 = dot(u, u), near = 2.0 * dot(abs(u), off) + 4e-6 * image.z;
    if (r2 - near > image.z) return kLost;
    if (!(r2 + near < image.z)) return kUnknown;
    off *= 1.0 + 3.0 * abs(b.x) * r2 + 5.0 * abs(b.y) * r2 * r2 + 6.0 * (abs(b.z) + abs(b.w)) * sqrt(r2);
  }
#endif
  position = through_lens(k, u);
  off = lens.xy * off + 2e-7 * (abs(position - lens.zw) + abs(lens.zw));
  vec2 last = image.xy - 0.5;
  if (!beyond) {
    if (any(lessThan(position + off, vec2(-0.5))) || any(greaterThan(position - off, last))) return kLost;
    if (!(all(greaterThan(position - off, vec2(-0.5))) && all(lessThan(position + off, last)))) return kUnknown;
  }
  return max(off.x, off.y) < MAX_POSITION_ERROR ? kSeen : kUnknown;
}
#endif

// The least of the pixels that a sample is made of, and where in between it is; beyond the outer pixels' centres these
// go on.
ivec2 pixel_before(inout vec2 position, vec2 image_size) {
#ifdef CAREFUL
  position = clamp(position, vec2(0.0), image_size - 1.0);
  ivec2 first = min(ivec2(position), max(ivec2(image_size) - 2, ivec2(0)));
#else
  ivec2 first = ivec2(position);
#endif
  position -= vec2(first);
  return first;
}

// Where the camera's image, or its luma, begins in the atlas.
ivec2 place_of(int k) { return ivec2(corner(k, CORNER_FROM).w, corner(k, CORNER_IMAGE).w); }

// What is lost is looked up as well, anywhere.
#ifdef CAREFUL
#define IN_ATLAS(at) clamp(at, ivec2(0), textureSize(images, 0) - 1)
#else
#define IN_ATLAS(at) (at)
#endif

uniform highp sampler2D images; // the atlas
uniform ivec4 chroma_places;    // kI420: where its Cb and Cr begin

// 0..1, at a position in an image of that size, which begins in the atlas at `place`.
#define TEXEL(at) texelFetch(images, IN_ATLAS(place + (at)), 0)
#ifdef RGB
vec3 rgb_of(int k, vec4 bytes) {
  int order = int(corner(k, CORNER_DOWN).w);
  return vec3(bytes[order & 3], bytes[(order >> 2) & 3], bytes[order >> 4]);
}
vec3 colour_at(int k, vec2 position) {
  ivec2 place = place_of(k), first = pixel_before(position, corner(k, CORNER_IMAGE).xy);
  vec3 upper = mix(rgb_of(k, TEXEL(first)), rgb_of(k, TEXEL(first + ivec2(1, 0))), position.x);
  vec3 lower = mix(rgb_of(k, TEXEL(first + ivec2(0, 1))), rgb_of(k, TEXEL(first + 1)), position.x);
  return mix(upper, lower, position.y);
}
#else
float sampled_byte(ivec2 place, vec2 image_size, vec2 position) {
  ivec2 first = pixel_before(position, image_size);
  return bilinear(textureGather(images, vec2(place + first + 1) / vec2(textureSize(images, 0))), position);
}
vec3 colour_at(int k, vec2 position) {
  return vec3(sampled_byte(place_of(k), corner(k, CORNER_IMAGE).xy, position));
}
// `position`: in the image of luma. Cb and Cr, in levels from grey on.
vec2 chroma_at(int k, vec2 position) {
  vec2 image_size = floor((corner(k, CORNER_IMAGE).xy + 1.0) / 2.0);
  ivec2 place = place_of(k) / 2;
  position = (position - 0.5) / 2.0;
  return 255.0 * vec2(sampled_byte(place + chroma_places.xy, image_size, position),
                      sampled_byte(place + chroma_places.zw, image_size, position)) - 128.0;
}
#endif

uint bits(float value) { return uint(int(floor(value + 0.5))) & 0xffffu; }
)";

}  // namespace lf::gl
