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

void define(std::string& text, std::string_view name, std::integral auto value) {
  text += "#define " + std::string(name) + " " + std::to_string(value) + "\n";
}

void declare(std::string& text, std::string_view name, double value, std::string_view times = "") {
  text += "const highp float " + std::string(name) + " = " + format_text("%f", value) + std::string(times) + ";\n";
}

std::string head(const SumProgram& program) {
  std::string text = "#version 310 es\n";
  using Output = SumProgram::Output;
  if (program.output == Output::kBlocksRgb || program.output == Output::kMomentsRgb ||
      program.output == Output::kPictureRgb)
    text += "#define RGB\n";
  if (!is_of_moments(program)) text += "#define CAREFUL\n";
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
  declare(text, "MAX_POSITION_ERROR", kMaxPositionError);
  declare(text, "FLOAT_ROUNDING", kFloatRounding * 1e6, " * 1e-6");
  declare(text, "MAX_WEIGHT_ERROR", kMaxWeightError);
  declare(text, "EYE_DOUBT", kEyeDoubt);
  return text;
}

}  // namespace

std::string compute_shader(const SumProgram& program) {
  if (is_of_picture(program)) return head(program).append(kPicture);
  if (program.output == SumProgram::Output::kAdded) return head(program).append(kAdding);
  if (program.output == SumProgram::Output::kImage) return head(program).append(kImage);
  const std::string text = head(program).append(kRule).append(kRuns);
  if (is_of_moments(program)) return text + std::string(kMoments);
  return text + std::string(kBlocks) + std::string(program.has_cells ? kBlockOfCells : kBlockOfFaces);
}

}  // namespace lf::gl
