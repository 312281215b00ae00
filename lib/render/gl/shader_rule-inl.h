// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <string_view>

namespace lf::gl {

// The rule of docs/design.md, with bounds of what float adds to it: each product and sum is good to 2^-24 of what goes
// into it, and five of them in a row to 3e-7.
inline constexpr std::string_view kRule = R"(
precision highp float;
precision highp int;
uniform highp usampler2D owners;     // of each pixel: its face's number and one, 0: none
uniform highp sampler2D tables;
uniform highp usampler2D levels;     // of the focal map
uniform highp sampler2D rays;        // of distorted views: lines of sight of pixels,
uniform highp sampler2D centre_rays; // and of the middle of four
uniform highp sampler2DArray images; // RGB or luma
uniform highp sampler2DArray chroma_images;
uniform ivec2 origin;     // of the target in the view
uniform ivec2 size;       // of the sum, pixels
uniform int first_slot;   // texel in the tables
uniform bool has_rays;
uniform bool has_map;
uniform vec2 map_scale;   // the step of nodes, pixels, and what a level adds to the inverse distance

const float kRounding = 3e-7;

vec4 table(int i) { return texelFetch(tables, ivec2(i % TABLE_WIDTH, i / TABLE_WIDTH), 0); }

// A place of the view: in pixels, and as edges and projections count it.
struct Place {
  vec2 pixel;
  vec2 at;
};
vec2 from_anchor(Place place, vec2 anchor) { return has_rays ? place.at : place.pixel - anchor; }

// Weights of a face's cameras.
struct Weights {
  vec3 w;
  ivec3 slot;
  bool doubt;
};
Weights weights_of(int face, Place place) {
  int texel = face * FACE_TEXELS;
  vec2 d = from_anchor(place, table(texel).xy);
  Weights result;
  vec3 e;
  float terms = 0.0;
  for (int k = 0; k < 3; k++) {
    vec4 edge = table(texel + FACE_EDGE + k);
    vec3 part = vec3(edge.xy * d, edge.z);
    e[k] = part.x + (part.y + part.z);
    terms += dot(abs(part), vec3(1.0));
    result.slot[k] = int(edge.w);
  }
  float sum = e.x + e.y + e.z;
  result.doubt = !(terms * kRounding < 2e-5 * abs(sum));
  result.w = clamp(e / sum, 0.0, 1.0);
  return result;
}

float level_at(vec2 pixel) {
  ivec2 count = textureSize(levels, 0);
  vec2 at = clamp((pixel + 0.5) / map_scale.x - 0.5, vec2(0.0), vec2(count - 1));
  ivec2 first = min(ivec2(at), max(count - 2, 0)), second = min(first + 1, count - 1);
  vec2 part = at - vec2(first);
  vec4 node = vec4(texelFetch(levels, first, 0).r, texelFetch(levels, ivec2(second.x, first.y), 0).r,
                   texelFetch(levels, ivec2(first.x, second.y), 0).r, texelFetch(levels, second, 0).r);
  vec2 row = mix(node.xz, node.yw, part.x);
  return mix(row.x, row.y, part.y);
}

const int kLost = 0, kSeen = 1, kUnknown = 2;

// Where a camera's image has what is in focus, and whether it does; `beyond`: whether places outside of the image are
// good, too.
int project(int slot, Place place, float level, bool beyond, out vec2 position) {
  int texel = first_slot + slot * SLOT_TEXELS;
  vec4 from = table(texel + SLOT_FROM), along = table(texel + SLOT_ALONG), down = table(texel + SLOT_DOWN);
  position = vec2(0.0);
  if ((int(down.w) & HAS_IMAGE) == 0) return kLost;
  vec2 d = from_anchor(place, vec2(from.w, along.w));
  vec3 x = from.xyz + (d.x * along.xyz + d.y * down.xyz);
  vec3 terms = abs(from.xyz) + abs(d.x * along.xyz) + abs(d.y * down.xyz);
  if (has_map) {
    vec4 per_from = table(texel + SLOT_PER_FROM), per_along = table(texel + SLOT_PER_ALONG),
         per_down = table(texel + SLOT_PER_DOWN);
    float nearer = (level - per_from.w) * map_scale.y;
    float eye = (per_down.w + nearer) * per_along.w;
    if (abs(1.0 - eye) <= 1e-5 * (1.0 + abs(eye))) return kUnknown;
    if (eye > 1.0) return kLost; // the surface is behind the eye
    vec3 per = per_from.xyz + (d.x * per_along.xyz + d.y * per_down.xyz);
    x += nearer * per;
    terms += abs(nearer) * (abs(per_from.xyz) + abs(d.x * per_along.xyz) + abs(d.y * per_down.xyz));
  }
  vec3 rounding = kRounding * terms;
  if (!(x.z > rounding.z)) return x.z < -rounding.z ? kLost : kUnknown;
  vec2 u = x.xy / x.z, doubt = (rounding.xy + abs(u) * rounding.z) / x.z;
  vec4 lens = table(texel + SLOT_LENS), image = table(texel + SLOT_IMAGE);
  if ((int(down.w) & IS_DISTORTED) != 0) {
    vec4 k = table(texel + SLOT_DISTORTION);
    float r2 = dot(u, u), near = 2.0 * dot(abs(u), doubt) + 4e-6 * image.x;
    if (r2 - near > image.x) return kLost;
    if (!(r2 + near < image.x)) return kUnknown;
    doubt *= 1.0 + 3.0 * abs(k.x) * r2 + 5.0 * abs(k.y) * r2 * r2 + 6.0 * (abs(k.z) + abs(k.w)) * sqrt(r2);
    u = u * (1.0 + r2 * (k.x + r2 * k.y)) + 2.0 * u.x * u.y * k.zw + k.wz * (r2 + 2.0 * u * u);
  }
  position = lens.xy * u + lens.zw;
  doubt = lens.xy * doubt + 2e-7 * (abs(lens.xy * u) + abs(lens.zw));
  vec2 last = image.yz - 0.5;
  if (!beyond) {
    if (any(lessThan(position + doubt, vec2(-0.5))) || any(greaterThan(position - doubt, last))) return kLost;
    if (!(all(greaterThan(position - doubt, vec2(-0.5))) && all(lessThan(position + doubt, last)))) return kUnknown;
  }
  return max(doubt.x, doubt.y) < MAX_POSITION_ERROR ? kSeen : kUnknown;
}

vec4 cubic_weights(float t) {
  float near = t * (1.0 - t) * (1.0 - t), far = t * t * (1.0 - t);
  return vec4(-near / 2.0, 1.0 - t + near - far / 2.0, t + far - near / 2.0, -far / 2.0);
}

vec4 texel(highp sampler2DArray from, int layer, ivec2 at) { return texelFetch(from, ivec3(at, layer), 0); }

// 0..1; beyond the outer pixels' centres they go on.
vec4 sampled(highp sampler2DArray from, int layer, ivec2 size, vec2 position, bool cubic) {
  vec2 at = clamp(position, vec2(0.0), vec2(size - 1));
  ivec2 first = ivec2(at), second = min(first + 1, size - 1);
  vec2 part = at - vec2(first);
  if (cubic) {
    vec4 across = cubic_weights(part.x), down = cubic_weights(part.y), sum = vec4(0.0);
    for (int j = 0; j < 4; j++)
      for (int i = 0; i < 4; i++)
        sum += down[j] * across[i] * texel(from, layer, clamp(first + ivec2(i, j) - 1, ivec2(0), size - 1));
    return clamp(sum, 0.0, 1.0);
  }
  vec4 upper = mix(texel(from, layer, first), texel(from, layer, ivec2(second.x, first.y)), part.x);
  vec4 lower = mix(texel(from, layer, ivec2(first.x, second.y)), texel(from, layer, second), part.x);
  return mix(upper, lower, part.y);
}

bool is_cubic(int slot) { return (int(table(first_slot + slot * SLOT_TEXELS + SLOT_DOWN).w) & IS_CUBIC) != 0; }

uint bits(float value) { return uint(int(floor(value + 0.5))) & 0xffffu; }
)";

}  // namespace lf::gl
