// SPDX-License-Identifier: LGPL-2.1-or-later
#include "render/gl/sum_shader.h"

#include <concepts>
#include <string_view>

#include "base/text.h"
#include "image/image_filters.h"
#include "render/camera_weights.h"
#include "render/gl/sum_shader-inl.h"

namespace lf::gl {
namespace {

// The compute shader of GpuSum::draw(), equivalent to resolve() in composite/. An invocation converts four pixels of a
// row (RGB), or 8 x 2 pixels and their chroma.
constexpr std::string_view kPicture = R"(
precision highp float;
precision highp int;
layout(local_size_x = GROUP, local_size_y = GROUP) in;

layout(std430, binding = RESULT) readonly buffer Sum { uint sum[]; }; // see BlockSum
layout(std430, binding = PICTURE) writeonly buffer Picture { uint picture[]; };
uniform uvec4 parts; // BlockSum: offsets of pixels, chroma and missing weight; number of the draw
uniform uint missing_rows; // BlockSum::Parts::missing_rows
uniform ivec2 origin, size, extent; // position of the sum in the view; size of the sum; size of the view
uniform uvec4 planes; // words per row of the first plane, and of chroma planes; first words of the chroma planes
uniform vec3 byte_levels; // GpuPicture: gain, offset, chroma_gain
uniform vec4 background; // colour; w: pixels with less weight show the background (32768 = weight 1)
uniform ivec4 channels; // RGB: bit offsets of R, G, B and the opaque byte (-1: none); kI420: w: 1: NV12

bool is_in_sum(ivec2 at) { return all(greaterThanEqual(at, ivec2(0))) && all(lessThan(at, size)); }

uint word_of(ivec2 at) { return uint(at.y) * (uint(size.x + 1) / 2u) + uint(at.x) / 2u; }

float value(uint word, int n) { return float(bitfieldExtract(int(sum[word]), 16 * n, 16)); }

// Returns the missing weight of a pixel of the sum; 32768 = weight 1.
float missing_at(ivec2 at) {
  if (sum[missing_rows + uint(at.y / 2)] != parts.w) return 0.0;
  return float(bitfieldExtract(sum[parts.z + word_of(at)], 16 * (at.x & 1), 16));
}

// Returns the factor from a sum to levels; 0: the pixel shows the background.
float scale_of(float missing) {
  float remaining = 32768.0 - missing;
  return remaining >= background.w ? 256.0 / remaining : 0.0;
}

uint byte_of(float level) { return uint(clamp(level + 0.5, 0.0, 255.0)); }

#ifdef RGB
uint pixel_at(ivec2 at) {
  vec3 colour = vec3(0.0);
  if (is_in_sum(at)) {
    float scale = scale_of(missing_at(at));
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
// Totals of a chroma sample's pixels: their number, missing weight, and the number that show the background.
struct Block { float pixels, missing, hidden; };

float luma_at(ivec2 at, inout Block block) {
  block.pixels += 1.0;
  float shown = 0.0;
  if (is_in_sum(at)) {
    float missing = missing_at(at), scale = scale_of(missing);
    block.missing += min(missing, 32768.0);
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
  float scale = scale_of(block.missing / block.pixels), share = scale > 0.0 ? block.hidden / block.pixels : 1.0;
  vec2 shown = mix(clamp(scale * sums, -128.0, 127.0), background.yz, share);
  return uvec2(byte_of(128.0 + byte_levels.z * shown.x), byte_of(128.0 + byte_levels.z * shown.y));
}

void main() {
  ivec2 group = ivec2(gl_GlobalInvocationID.xy), first = ivec2(8, 2) * group;
  if (any(greaterThanEqual(first, extent))) return;
  uint luma[4], chroma[2]; // two words for each of two rows; one word each of Cb and Cr, or two interleaved words
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

// The compute shader of BlockSums::add(). An invocation adds one word (two samples) to its position in a larger sum, or
// clears one word.
constexpr std::string_view kAdding = R"(
precision highp float;
precision highp int;
layout(local_size_x = GROUP, local_size_y = GROUP) in;

layout(std430, binding = RESULT) buffer Result { uint result[]; };
layout(std430, binding = PICTURE) readonly buffer Part { uint part[]; };
uniform ivec2 size;   // words per row, and rows
uniform uvec4 parts;  // first word and words per row in `part`; first word and words per row in `result`
uniform uvec4 planes; // x: kAdd, kAddMissing, else clear; y: missing_rows word of the first row; w: number of the draw

const uint kAdd = 0u, kAddMissing = 1u;

void main() {
  ivec2 at = ivec2(gl_GlobalInvocationID.xy);
  if (any(greaterThanEqual(at, size))) return;
  uint target = parts.z + uint(at.y) * parts.w + uint(at.x);
  if (planes.x > kAddMissing) {
    result[target] = 0u;
    return;
  }
  uint addend = part[parts.x + uint(at.y) * parts.y + uint(at.x)], previous = result[target];
  if (planes.x == kAdd) {
    ivec2 a = ivec2(bitfieldExtract(int(previous), 0, 16), int(previous) >> 16);
    ivec2 b = ivec2(bitfieldExtract(int(addend), 0, 16), int(addend) >> 16);
    uvec2 sum = uvec2(clamp(a + b, -32768, 32767)) & 0xffffu;
    result[target] = sum.x | sum.y << 16;
  } else {
    uvec2 a = uvec2(previous & 0xffffu, previous >> 16), b = uvec2(addend & 0xffffu, addend >> 16);
    uvec2 sum = min(a + b, 0xffffu);
    result[target] = sum.x | sum.y << 16;
    if (result[target] != 0u) result[planes.y + uint(at.y) / 2u] = planes.w;
  }
}
)";

// The compute shader of TextureStager, which does the same as divide_by_gain() and sharpen() of image/ in the same
// integer arithmetic. An invocation writes one word: a pixel of RGB, or four samples of a plane.
constexpr std::string_view kImage = R"(
precision highp float;
precision highp int;
layout(local_size_x = GROUP, local_size_y = GROUP) in;

layout(std430, binding = RESULT) writeonly buffer Result { uint result[]; };
uniform highp sampler2D gpu_image;
uniform ivec2 origin, size, extent; // first pixel of the region; size of the plane; columns and rows of words to write
uniform uvec4 parts;    // first word and words per row in `result`
uniform ivec4 channels; // texture channel of the plane (-1: RGB); gain_factor() (0: do not divide); its zero level;
                        // 1: sharpen

ivec4 divided_by_gain(ivec2 at) {
  vec4 texel = texelFetch(gpu_image, clamp(at, ivec2(0), size - 1), 0);
  ivec4 value = ivec4(floor(255.0 * (channels.x < 0 ? texel : vec4(texel[max(channels.x, 0)])) + 0.5));
  if (channels.y == 0) return value;
  ivec4 product = (128 * (value - channels.z) * channels.y) >> 16;
  return clamp(((product + 16) >> 5) + channels.z, 0, 255);
}

uvec4 filtered(ivec2 at) {
  ivec4 value = divided_by_gain(at);
  if (channels.w != 0) {
    ivec4 neighbours = divided_by_gain(at - ivec2(1, 0)) + divided_by_gain(at + ivec2(1, 0)) +
                       divided_by_gain(at - ivec2(0, 1)) + divided_by_gain(at + ivec2(0, 1));
    value = clamp(value + ((SHARPENING * (4 * value - neighbours) + 128) >> 8), 0, 255);
  }
  return uvec4(value);
}

void main() {
  ivec2 word = ivec2(gl_GlobalInvocationID.xy);
  if (any(greaterThanEqual(word, extent))) return;
  uvec4 bytes;
  if (channels.x < 0) {
    bytes = filtered(origin + word);
  } else {
    for (int n = 0; n < 4; n++) bytes[n] = filtered(origin + ivec2(4 * word.x + n, word.y)).x;
  }
  result[parts.x + uint(word.y) * parts.y + uint(word.x)] = bytes.x | bytes.y << 8 | bytes.z << 16 | bytes.w << 24;
}
)";

void define(std::string& text, std::string_view name, std::integral auto value) {
  text += "#define " + std::string(name) + " " + std::to_string(value) + "\n";
}

void declare(std::string& text, std::string_view name, double value, std::string_view times = "") {
  text += "const highp float " + std::string(name) + " = " + format_text("%f", value) + std::string(times) + ";\n";
}

std::string head(const SumProgram& program) {
  std::string text = "#version 310 es\n";
  using Output = SumProgram::Output;
  if (program.output == Output::kBlocksRgb || program.output == Output::kConsistencyRgb ||
      program.output == Output::kPictureRgb)
    text += "#define RGB\n";
  if (!is_of_consistency(program)) text += "#define CAREFUL\n";
  if (program.has_map) text += "#define MAP\n";
  if (program.has_rays) text += "#define RAYS\n";
  if (program.distortion != SumProgram::Distortion::kNone) text += "#define DISTORTED\n";
  if (program.distortion == SumProgram::Distortion::kGeneral) text += "#define GENERAL\n";
  if (program.has_cells) text += "#define CELLS\n";
  define(text, "CELL_BITS", WeightGrid::kStepBits);
  define(text, "WEIGHT_ONE", WeightGrid::kOne);
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
  define(text, "CORNER_GENERAL", int{kCornerGeneral});
  define(text, "CORNER_PRISM", int{kCornerPrism});
  define(text, "CORNER_STEEPNESS", int{kCornerSteepness});
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
  define_word("VIEW_SLOTS", kViewSlots);
  define_word("VIEW_WORDS", kViewWords);
  define(text, "HAS_IMAGE", int{kHasImage});
  define(text, "SHARPENING", kSharpeningFactor);
  define(text, "UNDECIDED", kUndecided);
  define(text, "CHROMA_UNDECIDED", kChromaUndecided);
  declare(text, "MAX_POSITION_ERROR", kMaxPositionError);
  declare(text, "FLOAT_ROUNDING", kFloatRounding * 1e6, " * 1e-6");
  declare(text, "MAX_WEIGHT_ERROR", kMaxWeightError);
  declare(text, "EYE_MARGIN", kEyeMargin);
  return text;
}

}  // namespace

std::string compute_shader(const SumProgram& program) {
  if (is_of_picture(program)) return head(program).append(kPicture);
  if (program.output == SumProgram::Output::kAdded) return head(program).append(kAdding);
  if (program.output == SumProgram::Output::kImage) return head(program).append(kImage);
  const std::string text = head(program).append(kRule).append(kRuns);
  if (is_of_consistency(program)) return text + std::string(kConsistency);
  return text + std::string(kBlocks) + std::string(kBlockOfCells) + std::string(kBlockOfFaces);
}

}  // namespace lf::gl
