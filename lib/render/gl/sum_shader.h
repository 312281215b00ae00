// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <compare>
#include <string>

// The programs that draw sums, in the shading language of OpenGL ES 3.1. What they are given is laid out here, for both
// sides.
//
// Properties of the view and of the cameras' kind are compiled in, because drivers that compute on the CPU execute both
// sides of every branch.
namespace lf::gl {

struct SumProgram {
  // The result.
  //   kBlocksRgb, kBlocksI420: a whole sum. If float can't decide whether a sample is lost, or can't determine its
  //     position to kMaxPositionError, the lost weight is kDoubt and Cb is kChromaDoubt.
  //   kMomentsRgb, kMomentsI420: moments of luma (focus/moments.h) from RGB images and from luma.
  //   kPictureRgb, kPictureI420: a picture made of a sum. kAdded: two sums added up. kImage: part of a camera's image,
  //     ready for sampling (see CardPieces). These ignore the members below.
  enum class Output {
    kBlocksRgb,
    kBlocksI420,
    kMomentsRgb,
    kMomentsI420,
    kPictureRgb,
    kPictureI420,
    kAdded,
    kImage
  } output = Output::kBlocksRgb;
  bool has_map = false;
  bool has_rays = false;      // the lines of sight come from a texture
  bool is_distorted = false;  // a camera's lens is
  bool has_cells = false;     // kBlocks alone: weights are those of a BlendGrid, and not of the mesh

  auto operator<=>(const SumProgram&) const = default;
};
inline constexpr int kDoubt = 0xffff, kChromaDoubt = 0x8000;

// Numbers in `tables`: texels of four, a row of them for each face; with a BlendGrid for each slot, whose camera is in
// the first corner.
enum FaceTexel {
  kFaceAnchor,  // x, y: what its pixels (or lines of sight, where these are looked up) are counted from; w: the level
                // that inverse distances are counted from
  kFaceEdge,    // three: edge function k is x i + y j + z; w: 1 if the camera in that corner is ours
  kFaceCorners = kFaceEdge + 3
};
enum CornerTexel {
  kCornerFrom,        // ProjectionTerms::from; w: x of its image's place in the atlas
  kCornerAlong,       // and along; w: CornerFlags
  kCornerDown,        // and down; w: RGB: which byte of a pixel is red, + 4 of green, + 16 of blue
  kCornerLens,        // fx, fy, cx, cy
  kCornerDistortion,  // k1, k2, p1, p2
  kCornerImage,       // width, height of the image in pixels; the largest squared radius; y of its place
  kCornerTexels,
  kCornerPerFrom = kCornerTexels,  // with a focal map: ProjectionTerms::per_from; w: of moments: pixels a side of what
                                   // luma is the mean of, even
  kCornerPerAlong,
  kCornerPerDown,
  kMapCornerTexels
};
constexpr int corner_texels(bool has_map) { return has_map ? kMapCornerTexels : kCornerTexels; }
constexpr int face_texels(bool has_map) { return kFaceCorners + 3 * corner_texels(has_map); }
enum CornerFlags { kHasImage = 1 };

// The data of each view of a pass: 32-bit words, in front of all views' runs.
enum ViewWord {
  kViewOrigin,       // x, y of what is drawn in the view
  kViewSize = 2,     // of that, pixels
  kViewRuns = 4,     // where its runs begin
  kViewFaces,        // the row of the tables that its first face has
  kViewLevels,       // the row of the texture of levels that its map begins with
  kViewNodes,        // columns, rows of the map
  kViewScale = 9,    // MapScale, in float
  kViewResult = 13,  // six words about where its sum is, see BlockSum
  kViewCells = 19,   // where its cells begin, see make_cells()
  kViewWords
};

// Pixels of a camera's image.
inline constexpr double kMaxPositionError = 1.0 / 128;
// Of float: each product and sum is good to 2^-24 of what goes into it, and five of them in a row to this.
inline constexpr double kFloatRounding = 3e-7;
// How much of a weight float may be off by.
inline constexpr double kMaxWeightError = 2e-5;
// How near to the eye a focal surface may be for float not to tell on which side of it.
inline constexpr double kEyeDoubt = 1e-5;

// Words of a camera in a cell: the row of the tables, and its running sums at each of the four points, without the
// camera in the low 16 bits and with it in the high ones.
inline constexpr int kCellWords = 5;

// Buffers of a program, and invocations a side of a group of it. OpenGL ES 3.1 promises four bindings.
enum BufferBinding {
  kRunsBinding,
  kTablesBinding,
  kResultBinding,
  kSurfacesBinding,
  kPictureBinding = kSurfacesBinding  // no program has both
};
inline constexpr int kGroup = 8;

inline bool is_of_moments(const SumProgram& program) {
  return program.output == SumProgram::Output::kMomentsRgb || program.output == SumProgram::Output::kMomentsI420;
}
inline bool is_of_picture(const SumProgram& program) {
  return program.output == SumProgram::Output::kPictureRgb || program.output == SumProgram::Output::kPictureI420;
}

std::string compute_shader(const SumProgram& program);

}  // namespace lf::gl
