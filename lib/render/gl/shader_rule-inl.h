// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <string_view>

namespace lf::gl {

// The rule of docs/design.md, if careful with bounds of what float adds to it.
inline constexpr std::string_view kRule = R"(
precision highp float;
precision highp int;
uniform highp sampler2D owners;      // of each pixel: its face's depth, 0: none
uniform highp usampler2D levels;     // of the focal map: of four nodes each
uniform highp sampler2D rays;        // of distorted views: lines of sight of pixels,
uniform highp sampler2D centre_rays; // and of the middle of four
uniform ivec2 origin;     // of the target in the view
uniform ivec2 size;       // of the sum, pixels
uniform vec4 map_scale;   // the step of nodes, pixels; inverse distance of level 0, of a level more; eye distance

flat in vec4 face[FACE_TEXELS];

vec4 edge(int k) { return face[FACE_EDGE + k]; }
vec4 corner(int k, int texel) { return face[FACE_CORNERS + k * CORNER_TEXELS + texel]; }

bool doubt = false;

bool is_owner(ivec2 at) { return abs(texelFetch(owners, at, 0).r - face[0].z) < 0.25 / OWNERS; }

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

#ifdef MAP
// From the face's level.
float level_at(vec2 pixel) {
  ivec2 cells = textureSize(levels, 0);
  vec2 at = clamp((pixel + 0.5) / map_scale.x - 0.5, vec2(0.0), vec2(cells));
  ivec2 cell = min(ivec2(at), cells - 1);
  vec2 part = at - vec2(cell);
  vec4 node = vec4(texelFetch(levels, cell, 0));
  vec2 row = mix(node.xz, node.yw, part.x);
  return mix(row.x, row.y, part.y) - face[0].w;
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
  float eye = (map_scale.y + (level + face[0].w) * map_scale.z) * map_scale.w;
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

vec4 cubic_weights(float t, bool is_cubic) {
  float near = t * (1.0 - t) * (1.0 - t), far = t * t * (1.0 - t);
  return is_cubic ? vec4(-near / 2.0, 1.0 - t + near - far / 2.0, t + far - near / 2.0, -far / 2.0)
                  : vec4(0.0, 1.0 - t, t, 0.0);
}

// The least of the pixels that a sample is made of, and where in between it is; beyond the outer pixels' centres these
// go on.
ivec2 pixel_before(inout vec2 position, vec2 image_size) {
#if defined(CAREFUL) || defined(CUBIC)
  position = clamp(position, vec2(0.0), image_size - 1.0);
  ivec2 first = min(ivec2(position), max(ivec2(image_size) - 2, ivec2(0)));
#else
  ivec2 first = ivec2(position);
#endif
  position -= vec2(first);
  return first;
}

// Where the camera's image begins in the atlas.
ivec2 place_of(int k) { return ivec2(corner(k, CORNER_FROM).w, corner(k, CORNER_IMAGE).w); }

// Where textureGather() has the pixels (at.x, at.y + 1), (at.x + 1, at.y + 1), (at.x + 1, at.y) and (at.x, at.y).
vec2 gathered(ivec2 at, ivec2 atlas_size) { return vec2(at + 1) / vec2(atlas_size); }
float bilinear(vec4 gathered, vec2 part) {
  vec2 column = mix(gathered.wx, gathered.zy, part.x);
  return mix(column.x, column.y, part.y);
}

// What is lost is looked up as well, anywhere.
#if defined(CAREFUL) || defined(CUBIC)
#define IN_ATLAS(at) clamp(at, ivec2(0), textureSize(images, 0) - 1)
#else
#define IN_ATLAS(at) (at)
#endif

#ifdef RGB
uniform highp sampler2D images;
#define PLACE(k) place_of(k)
#define TEXEL(at) texel_of(k, texelFetch(images, IN_ATLAS(at), 0))
vec3 texel_of(int k, vec4 bytes) {
  int order = int(corner(k, CORNER_DOWN).w);
  return vec3(bytes[order & 3], bytes[(order >> 2) & 3], bytes[order >> 4]);
}
#elif defined(CHROMA)
uniform highp usampler2D images; // Cb, and Cr in the next eight bits
#define PLACE(k) (place_of(k) / 2)
#define TEXEL(at) texel_of(texelFetch(images, IN_ATLAS(at), 0).r)
vec3 texel_of(uint both) { return vec3(both & 255u, both >> 8, 0) / 255.0; }
#else
uniform highp sampler2D images;
#define PLACE(k) place_of(k)
#define TEXEL(at) vec3(texelFetch(images, IN_ATLAS(at), 0).r)
#endif

// 0..1, at a position in camera k's image of that size.
vec3 sampled(int k, vec2 image_size, vec2 position) {
  ivec2 first = pixel_before(position, image_size), place = PLACE(k);
#ifdef CUBIC
  bool is_cubic = (int(corner(k, CORNER_ALONG).w) & IS_CUBIC) != 0;
  vec4 across = cubic_weights(position.x, is_cubic), down = cubic_weights(position.y, is_cubic);
  ivec2 last = ivec2(image_size) - 1;
  vec3 sum = vec3(0.0);
  for (int j = 0; j < 4; j++)
    for (int i = 0; i < 4; i++)
      sum += down[j] * across[i] * TEXEL(place + clamp(first + ivec2(i, j) - 1, ivec2(0), last));
  return clamp(sum, 0.0, 1.0);
#elif defined(RGB)
  first += place;
  vec3 upper = mix(TEXEL(first), TEXEL(first + ivec2(1, 0)), position.x);
  vec3 lower = mix(TEXEL(first + ivec2(0, 1)), TEXEL(first + ivec2(1, 1)), position.x);
  return mix(upper, lower, position.y);
#elif defined(CHROMA)
  uvec4 both = textureGather(images, gathered(place + first, textureSize(images, 0)));
  return vec3(bilinear(vec4(both & 255u), position), bilinear(vec4(both >> 8), position), 0) / 255.0;
#else
  return vec3(bilinear(textureGather(images, gathered(place + first, textureSize(images, 0))), position));
#endif
}

uint bits(float value) { return uint(int(floor(value + 0.5))) & 0xffffu; }
)";

}  // namespace lf::gl
