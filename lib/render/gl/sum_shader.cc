// SPDX-License-Identifier: LGPL-2.1-or-later
#include "render/gl/sum_shader.h"

#include <string_view>

#include "render/gl/shader_rule-inl.h"

namespace lf::gl {
namespace {

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
  text += kRule;
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
