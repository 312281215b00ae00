// SPDX-License-Identifier: LGPL-2.1-or-later
#include "render/gl/sum_shader.h"

#include <concepts>
#include <string_view>

#include "base/number_text.h"
#include "image/correction.h"
#include "render/camera_weights.h"
#include "render/gl/adding_shader-inl.h"
#include "render/gl/block_shader-inl.h"
#include "render/gl/image_shader-inl.h"
#include "render/gl/moment_shader-inl.h"
#include "render/gl/picture_shader-inl.h"
#include "render/gl/run_shader-inl.h"
#include "render/gl/shader_rule-inl.h"

namespace lf::gl {
namespace {

constexpr std::string_view kVertex = R"(
precision highp float;
precision highp int;
layout(location = 0) in vec2 at;        // pixels of the view
layout(location = 1) in highp uint row; // of the tables
uniform highp sampler2D tables;
uniform ivec2 origin;
uniform vec2 extent; // of the target, pixels of the view
flat out vec4 face[FACE_TEXELS];
void main() {
  for (int i = 0; i < FACE_TEXELS; i++) face[i] = texelFetch(tables, ivec2(i, int(row)), 0);
#ifdef MIXED
  float depth = 1.0;
#else
  float depth = face[0].z;
#endif
  gl_Position = vec4((at + 0.5 - vec2(origin)) / extent * 2.0 - 1.0, depth * 2.0 - 1.0, 1.0);
}
)";

// One triangle over the whole target.
constexpr std::string_view kWholeTarget = R"(
void main() { gl_Position = vec4(gl_VertexID == 1 ? 3.0 : -1.0, gl_VertexID == 2 ? 3.0 : -1.0, 1.0, 1.0); }
)";

constexpr std::string_view kPixels = R"(
#ifdef RGB
layout(location = 0) out highp uvec4 result;
#else
layout(location = 0) out highp uint result;
#endif
#ifdef CAREFUL
layout(location = 1) out highp uint lost_bits;
#endif

void main() {
  ivec2 here = ivec2(gl_FragCoord.xy);
  vec2 pixel = vec2(here + origin);
#ifdef RAYS
  vec2 d = texelFetch(rays, here, 0).xy;
#else
  vec2 d = pixel - face[0].xy;
#endif
  vec3 w = weights_at(d), sum = vec3(0.0);
  float level = level_at(pixel), lost = 0.0;
  for (int k = 0; k < 3; k++) {
#ifdef CAREFUL
    vec2 position = vec2(0.0);
    int sight = w[k] > 0.0 ? project(k, d, level, false, position) : kSeen;
    doubt = doubt || sight == kUnknown;
    if (sight == kLost) lost += w[k];
    if (sight != kSeen) w[k] = 0.0;
#else
    vec3 x = camera_point(k, d, level * map_scale.z);
    vec2 position = through_lens(k, x.xy / x.z);
#endif
    sum += w[k] * colour_at(k, position);
  }
  sum *= 255.0 * 128.0;
#ifdef RGB
  result = uvec4(bits(sum.r), bits(sum.g), bits(sum.b), 0u);
#else
  result = bits(sum.x);
#endif
#ifdef CAREFUL
  lost_bits = doubt ? uint(DOUBT) : bits(32768.0 * lost);
#endif
}
)";

// A camera's chroma is sampled in the middle of four pixels and weighs the mean of what it gives to them. Where all
// four are the face's, and it is calm, that is its weight in the middle; of others, if they have several owners, each
// face adds its part to sums.
constexpr std::string_view kChroma = R"(
#ifdef MIXED
layout(location = 0) out highp vec2 result;
#else
layout(location = 0) out highp uvec2 result;
#endif

// What each camera weighs in the pixels of the block that are the face's, by how many pixels it has.
vec3 weights_in(ivec2 first, ivec2 last) {
  vec3 w = vec3(0.0);
  float pixels = 0.0;
  for (int n = 0; n < 4; n++) {
    ivec2 at = first + ivec2(n & 1, n >> 1);
    bool counts = all(lessThanEqual(at, last));
    pixels += counts ? 1.0 : 0.0;
    at = min(at, last);
#ifdef MIXED
    counts = counts && is_owner(at);
#endif
    vec2 pixel = vec2(at + origin);
#ifdef RAYS
    vec2 d = texelFetch(rays, at, 0).xy;
#else
    vec2 d = pixel - face[0].xy;
#endif
#ifdef CAREFUL
    if (!counts) continue;
    vec3 of_pixel = weights_at(d);
    float level = level_at(pixel);
    for (int k = 0; k < 3; k++) {
      vec2 position = vec2(0.0);
      int sight = of_pixel[k] > 0.0 ? project(k, d, level, false, position) : kLost;
      doubt = doubt || sight == kUnknown;
      if (sight == kSeen) w[k] += of_pixel[k];
    }
#else
    w += counts ? weights_at(d) : vec3(0.0);
#endif
  }
  return w / pixels;
}

void main() {
  ivec2 here = ivec2(gl_FragCoord.xy);
  ivec2 first = 2 * here, last = min(first + 1, size - 1); // at the view's end there is no other
#ifdef RAYS
  vec2 centre = texelFetch(centre_rays, here, 0).xy;
#else
  vec2 centre = vec2(first + last) / 2.0 + vec2(origin) - face[0].xy;
#endif
#if defined(CAREFUL) || defined(MIXED)
  vec3 w = weights_in(first, last);
#else
  vec3 w = weights_at(centre);
#endif
  float level = level_at(vec2(first + origin) + 0.5);
  vec2 sum = vec2(0.0);
  for (int k = 0; k < 3; k++) {
#ifdef CAREFUL
    vec2 position = vec2(0.0);
    if (w[k] > 0.0 && project(k, centre, level, true, position) != kSeen) {
      doubt = true;
      w[k] = 0.0;
    }
#else
    vec3 x = camera_point(k, centre, level * map_scale.z);
    vec2 position = through_lens(k, x.xy / x.z);
#endif
    sum += w[k] * chroma_at(k, position);
  }
#ifdef MIXED
  result = doubt ? vec2(FLOAT_DOUBT, 0.0) : sum;
#else
  result = doubt ? uvec2(CHROMA_DOUBT, 0) : uvec2(bits(128.0 * sum.x), bits(128.0 * sum.y));
#endif
}
)";

constexpr std::string_view kChromaBits = R"(
precision highp float;
precision highp int;
uniform highp sampler2D chroma_sums;
layout(location = 0) out highp uvec2 result;
void main() {
  vec2 sum = texelFetch(chroma_sums, ivec2(gl_FragCoord.xy), 0).rg;
  uvec2 bits = uvec2(ivec2(floor(128.0 * sum + 0.5))) & 0xffffu;
  result = sum.x > FLOAT_DOUBT / 2.0 ? uvec2(CHROMA_DOUBT, 0) : bits;
}
)";
// Four of them, and what else is added to them, are finite in 16 bits and beyond all sums.
constexpr double kFloatDoubt = 8192;

void define(std::string& text, std::string_view name, std::integral auto value) {
  text += "#define " + std::string(name) + " " + std::to_string(value) + "\n";
}

void declare(std::string& text, std::string_view name, double value, std::string_view times = "") {
  text += "const highp float " + std::string(name) + " = " + format_text("%f", value) + std::string(times) + ";\n";
}

std::string head(const SumProgram& program) {
  std::string text = "#version 310 es\n";
  using Output = SumProgram::Output;
  if (program.output == Output::kRgb || program.output == Output::kBlocksRgb || program.output == Output::kMomentsRgb ||
      program.output == Output::kPictureRgb)
    text += "#define RGB\n";
  if (program.output == Output::kMixedChroma) text += "#define MIXED\n";
  if (is_computed(program)) text += "#define COMPUTED\n";
  if (program.careful) text += "#define CAREFUL\n";
  if (program.has_map) text += "#define MAP\n";
  if (program.has_rays) text += "#define RAYS\n";
  if (program.is_distorted) text += "#define DISTORTED\n";
  define(text, "CELL_BITS", BlendGrid::kStepBits);
  define(text, "WEIGHT_ONE", BlendGrid::kOne);
  define(text, "CELL_WORDS", kCellWords);
  define(text, "RUNS", int{kRunsBinding});
  define(text, "TABLES", int{kTablesBinding});
  define(text, "RESULT", int{kResultBinding});
  define(text, "SURFACES", int{kSurfacesBinding});
  define(text, "PICTURE", int{kPictureBinding});
  define(text, "GROUP", kGroup);
  define(text, "FACE_TEXELS", face_texels(program.has_map));
  define(text, "FACE_EDGE", int{kFaceEdge});
  define(text, "FACE_CORNERS", int{kFaceCorners});
  define(text, "CORNER_TEXELS", corner_texels(program.has_map));
  define(text, "CORNER_FROM", int{kCornerFrom});
  define(text, "CORNER_ALONG", int{kCornerAlong});
  define(text, "CORNER_DOWN", int{kCornerDown});
  define(text, "CORNER_LENS", int{kCornerLens});
  define(text, "CORNER_DISTORTION", int{kCornerDistortion});
  define(text, "CORNER_IMAGE", int{kCornerImage});
  define(text, "CORNER_PER_FROM", int{kCornerPerFrom});
  define(text, "CORNER_PER_ALONG", int{kCornerPerAlong});
  define(text, "CORNER_PER_DOWN", int{kCornerPerDown});
  const auto define_word = [&text](std::string_view name, ViewWord word) {
    text += "#define " + std::string(name) + " " + std::to_string(word) + "u\n";
  };
  define_word("VIEW_ORIGIN", kViewOrigin);
  define_word("VIEW_SIZE", kViewSize);
  define_word("VIEW_RUNS", kViewRuns);
  define_word("VIEW_FACES", kViewFaces);
  define_word("VIEW_LEVELS", kViewLevels);
  define_word("VIEW_NODES", kViewNodes);
  define_word("VIEW_SCALE", kViewScale);
  define_word("VIEW_RESULT", kViewResult);
  define_word("VIEW_CELLS", kViewCells);
  define_word("VIEW_WORDS", kViewWords);
  define(text, "HAS_IMAGE", int{kHasImage});
  define(text, "SHARPENING", kSharpeningFactor);
  define(text, "DOUBT", kDoubt);
  define(text, "CHROMA_DOUBT", kChromaDoubt);
  declare(text, "OWNERS", kMixedOwners);
  declare(text, "MAX_POSITION_ERROR", kMaxPositionError);
  declare(text, "FLOAT_ROUNDING", kFloatRounding * 1e6, " * 1e-6");
  declare(text, "MAX_WEIGHT_ERROR", kMaxWeightError);
  declare(text, "EYE_DOUBT", kEyeDoubt);
  declare(text, "FLOAT_DOUBT", kFloatDoubt);
  return text;
}

}  // namespace

std::string vertex_shader(const SumProgram& program) {
  const bool whole = program.output == SumProgram::Output::kChromaBits;
  return head(program).append(whole ? kWholeTarget : kVertex);
}

std::string compute_shader(const SumProgram& program) {
  if (is_of_picture(program)) return head(program).append(kPicture);
  if (program.output == SumProgram::Output::kAdded) return head(program).append(kAdding);
  if (program.output == SumProgram::Output::kImage) return head(program).append(kImage);
  const std::string text = head(program).append(kRule).append(kRuns);
  if (is_of_moments(program)) return text + std::string(kMoments);
  return text + std::string(kBlocks) + std::string(program.has_cells ? kBlockOfCells : kBlockOfFaces);
}

std::string fragment_shader(const SumProgram& program) {
  std::string text = head(program);
  if (program.output == SumProgram::Output::kChromaBits) return text.append(kChromaBits);
  const bool pixels = program.output == SumProgram::Output::kRgb || program.output == SumProgram::Output::kLuma;
  return text.append(kRule).append(pixels ? kPixels : kChroma);
}

}  // namespace lf::gl
