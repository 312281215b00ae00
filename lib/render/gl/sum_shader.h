// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <compare>
#include <string>

// The compute shaders, in OpenGL ES 3.1's shading language, and the layout of their inputs for both sides.
//
// Properties of the view and of the cameras are compiled in, because drivers that compute on the CPU execute both sides
// of every branch.
namespace lf::gl {

struct SumProgram {
  // The result of the program:
  //   kBlocksRgb, kBlocksI420: a whole sum. If float cannot decide whether a sample is missing, or cannot determine its
  //     position to kMaxPositionError, the missing weight is kUndecided and Cb is kChromaUndecided.
  //   kConsistencyRgb, kConsistencyI420: photo-consistency sums (focus/photo_consistency.h) from RGB or luma.
  //   kPictureRgb, kPictureI420: a picture made from a sum.
  //   kAdded: the total of two sums.
  //   kImage: a part of a camera's image that is ready for sampling (see TextureStager).
  // Programs for pictures, kAdded and kImage ignore the members below.
  enum class Output {
    kBlocksRgb,
    kBlocksI420,
    kConsistencyRgb,
    kConsistencyI420,
    kPictureRgb,
    kPictureI420,
    kAdded,
    kImage
  } output = Output::kBlocksRgb;
  bool has_map = false;
  bool has_rays = false;      // the lines of sight come from a texture
  bool is_distorted = false;  // at least one camera has lens distortion
  bool has_cells = false;     // weights come from a WeightGrid instead of the mesh; only for kBlocks

  auto operator<=>(const SumProgram&) const = default;
};
inline constexpr int kUndecided = 0xffff, kChromaUndecided = 0x8000;

// The table `tables` has a row of texels with four components for each face. Views with a WeightGrid have a row for
// each slot instead, with the camera in the first corner.
enum FaceTexel {
  // x, y: origin of the row's pixels (or lines of sight, if has_rays); w: origin of inverse distances, as a level
  kFaceAnchor,
  kFaceEdge,  // three texels: edge function k is x i + y j + z; w is 1 if the camera in that corner is local
  kFaceCorners = kFaceEdge + 3
};
enum CornerTexel {
  kCornerFrom,   // ProjectionTerms::from; w: x of the image's offset in the atlas
  kCornerAlong,  // ProjectionTerms::along; w: CornerFlags
  kCornerDown,   // ProjectionTerms::down; w for RGB: byte index of red, + 4 * green, + 16 * blue
  kCornerLens,   // fx, fy, cx, cy
  kCornerDistortion,
  kCornerImage,  // width and height of the image in pixels, largest squared radius, y of the offset in the atlas
  kCornerTexels,
  // These texels exist only with a focal map. ProjectionTerms::per_from; w: even side of the box for mean luma, pixels
  kCornerPerFrom = kCornerTexels,
  kCornerPerAlong,
  kCornerPerDown,
  kMapCornerTexels
};
constexpr int corner_texels(bool has_map) { return has_map ? kMapCornerTexels : kCornerTexels; }
constexpr int face_texels(bool has_map) { return kFaceCorners + 3 * corner_texels(has_map); }
enum CornerFlags { kHasImage = 1 };

// For each view of a pass, these 32-bit words precede the runs of all views.
enum ViewWord {
  kViewOrigin,       // x, y of the rendered region in the view
  kViewSize = 2,     // size of that region, pixels
  kViewRuns = 4,     // index of the view's first run
  kViewFaces,        // table row of the view's first face
  kViewLevels,       // first row of the view's focal map in the texture of levels
  kViewNodes,        // columns and rows of the map
  kViewScale = 9,    // MapScale, float
  kViewResult = 13,  // six words with the location of the view's sum; see BlockSum
  kViewCells = 19,   // index of the view's first cell; see make_cells()
  kViewSlots,        // table row of the view's first slot, after its last face; only with cells
  kViewWords
};

// Pixels of the camera image.
inline constexpr double kMaxPositionError = 1.0 / 128;
// Relative error of a float after five operations, because each product and sum is good to 2^-24.
inline constexpr double kFloatRounding = 3e-7;
// Largest error of a weight in float.
inline constexpr double kMaxWeightError = 2e-5;
// Distance of a focal surface from the eye, relative to its terms, below which float precision cannot decide whether
// the surface is behind the eye.
inline constexpr double kEyeMargin = 1e-5;

// Words of a camera in a cell: the table row, then a word for each of the cell's four corners. It contains the running
// sums of weights, before the camera in the low 16 bits and with the camera in the high 16 bits.
inline constexpr int kCellWords = 5;

// Bindings of a program's buffers. OpenGL ES 3.1 guarantees only four.
enum BufferBinding {
  kRunsBinding,
  kTablesBinding,
  kResultBinding,
  kSurfacesBinding,
  kPictureBinding = kSurfacesBinding  // unused together
};
inline constexpr int kGroup = 8;

inline bool is_of_consistency(const SumProgram& program) {
  return program.output == SumProgram::Output::kConsistencyRgb ||
         program.output == SumProgram::Output::kConsistencyI420;
}
inline bool is_of_picture(const SumProgram& program) {
  return program.output == SumProgram::Output::kPictureRgb || program.output == SumProgram::Output::kPictureI420;
}

std::string compute_shader(const SumProgram& program);

}  // namespace lf::gl
