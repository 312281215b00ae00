// SPDX-License-Identifier: LGPL-2.1-or-later
#include "render/gl/sum_shader.h"

#include <string_view>

namespace lf::gl {
namespace {

// The rule of docs/design.md, with bounds of what float adds to it: each product and sum is good to 2^-24 of what goes
// into it, and five of them in a row to 3e-7.
constexpr std::string_view kCommon = R"(
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

constexpr std::string_view kPixels = R"(
#ifdef RGB
layout(location = 0) out highp uvec4 result;
#else
layout(location = 0) out highp uvec2 result;
layout(location = 1) out highp uint seen;
#endif

void main() {
  ivec2 here = ivec2(gl_FragCoord.xy);
  int owner = int(texelFetch(owners, here, 0).r);
#ifdef RGB
  result = uvec4(0u);
#else
  result = uvec2(0u);
  seen = 0u;
#endif
  if (owner == 0) return;
  Place place = Place(vec2(here + origin), has_rays ? texelFetch(rays, here, 0).xy : vec2(0.0));
  Weights weights = weights_of(owner - 1, place);
  float level = has_map ? level_at(place.pixel) : 0.0;
  bool doubt = weights.doubt;
  float lost = 0.0;
  vec3 sum = vec3(0.0);
  for (int k = 0; k < 3; k++) {
    int slot = weights.slot[k];
    float w = weights.w[k];
    if (slot < 0 || w == 0.0) continue;
    vec2 position;
    int sight = project(slot, place, level, false, position);
    doubt = doubt || sight == kUnknown;
    if (sight == kLost) lost += w;
    if (sight != kSeen) continue;
    vec4 image = table(first_slot + slot * SLOT_TEXELS + SLOT_IMAGE);
    vec4 colour = sampled(images, int(image.w), ivec2(image.yz), position, is_cubic(slot));
#ifdef RGB
    ivec3 order = ivec3(table(first_slot + slot * SLOT_TEXELS + SLOT_ORDER).xyz);
    sum += w * vec3(colour[order.x], colour[order.y], colour[order.z]);
#else
    sum.x += w * colour.r;
    seen |= 1u << uint(k);
#endif
  }
  uint lost_bits = doubt ? uint(DOUBT) : bits(32768.0 * lost);
  sum *= 255.0 * 128.0;
#ifdef RGB
  result = uvec4(bits(sum.r), bits(sum.g), bits(sum.b), lost_bits);
#else
  result = uvec2(bits(sum.x), lost_bits);
  if (doubt) seen |= 8u;
#endif
}
)";

// A camera's chroma is sampled in the middle of four pixels and weighs the mean of what it gives to them.
constexpr std::string_view kChroma = R"(
uniform highp usampler2D luma_seen;
layout(location = 0) out highp uvec2 result;

bool doubt = false;
vec2 sum = vec2(0.0);

void add(Weights weights, vec3 w, Place centre, float level) {
  for (int k = 0; k < 3; k++) {
    if (w[k] == 0.0) continue;
    int slot = weights.slot[k];
    vec2 position;
    if (project(slot, centre, level, true, position) != kSeen) {
      doubt = true;
      continue;
    }
    vec4 image = table(first_slot + slot * SLOT_TEXELS + SLOT_IMAGE);
    ivec2 chroma_size = (ivec2(image.yz) + 1) / 2;
    vec4 colour = sampled(chroma_images, int(image.w), chroma_size, (position - 0.5) / 2.0, is_cubic(slot));
    sum += w[k] * (255.0 * colour.rg - 128.0);
  }
}

void main() {
  ivec2 here = ivec2(gl_FragCoord.xy);
  ivec2 first = 2 * here, last = min(first + 1, size - 1); // at the view's end there is no other
  Place centre;
  centre.pixel = vec2(first + last) / 2.0 + vec2(origin);
  centre.at = has_rays ? texelFetch(centre_rays, here, 0).xy : vec2(0.0);
  float level = has_map ? level_at(vec2(first + origin) + 0.5) : 0.0;
  float pixels = 0.0;
  int owner = 0;
  Weights weights;
  vec3 of_owner = vec3(0.0);
  for (int n = 0; n < 4; n++) {
    ivec2 pixel = 2 * here + ivec2(n & 1, n >> 1);
    if (any(greaterThanEqual(pixel, size))) continue;
    pixels += 1.0;
    int next = int(texelFetch(owners, pixel, 0).r);
    if (next == 0) continue;
    uint seen = texelFetch(luma_seen, pixel, 0).r;
    doubt = doubt || (seen & 8u) != 0u;
    if (next != owner && owner != 0) {
      add(weights, of_owner, centre, level);
      of_owner = vec3(0.0);
    }
    owner = next;
    weights = weights_of(owner - 1, Place(vec2(pixel + origin), has_rays ? texelFetch(rays, pixel, 0).xy : vec2(0.0)));
    of_owner += weights.w * vec3(seen & 1u, (seen >> 1) & 1u, (seen >> 2) & 1u);
  }
  if (owner != 0) add(weights, of_owner, centre, level);
  sum *= 128.0 / pixels;
  result = doubt ? uvec2(CHROMA_DOUBT, 0) : uvec2(bits(sum.x), bits(sum.y));
}
)";

void define(std::string& text, std::string_view name, auto value) {
  text += "#define " + std::string(name) + " " + std::to_string(value) + "\n";
}

}  // namespace

std::string sum_shader(SumProgram program) {
  std::string text = "#version 310 es\n";
  if (program == SumProgram::kRgb) text += "#define RGB\n";
  define(text, "TABLE_WIDTH", kTableWidth);
  define(text, "FACE_TEXELS", int{kFaceTexels});
  define(text, "FACE_EDGE", int{kFaceEdge});
  define(text, "SLOT_TEXELS", int{kSlotTexels});
  define(text, "SLOT_FROM", int{kSlotFrom});
  define(text, "SLOT_ALONG", int{kSlotAlong});
  define(text, "SLOT_DOWN", int{kSlotDown});
  define(text, "SLOT_PER_FROM", int{kSlotPerFrom});
  define(text, "SLOT_PER_ALONG", int{kSlotPerAlong});
  define(text, "SLOT_PER_DOWN", int{kSlotPerDown});
  define(text, "SLOT_LENS", int{kSlotLens});
  define(text, "SLOT_DISTORTION", int{kSlotDistortion});
  define(text, "SLOT_IMAGE", int{kSlotImage});
  define(text, "SLOT_ORDER", int{kSlotOrder});
  define(text, "HAS_IMAGE", int{kHasImage});
  define(text, "IS_DISTORTED", int{kIsDistorted});
  define(text, "IS_CUBIC", int{kIsCubic});
  define(text, "DOUBT", kDoubt);
  define(text, "CHROMA_DOUBT", kChromaDoubt);
  define(text, "MAX_POSITION_ERROR", kMaxPositionError);
  text += kCommon;
  text += program == SumProgram::kChroma ? kChroma : kPixels;
  return text;
}

std::string vertex_shader() {
  return R"(#version 310 es
void main() {
  gl_Position = vec4(gl_VertexID == 1 ? 3.0 : -1.0, gl_VertexID == 2 ? 3.0 : -1.0, 0.0, 1.0);
}
)";
}

}  // namespace lf::gl
