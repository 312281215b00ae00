// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <compare>
#include <string>

// The compute shaders, in OpenGL ES 3.1's shading language, and the layout of their inputs for both sides.
//
// Properties of the view and of the cameras are compiled in, because drivers that compute on the CPU execute both sides
// of every branch.
namespace lf::gl {

// The properties of a shader program. compute_shader() generates its text.
struct SumProgram {
  // The result of the program:
  //   kBlocksRgb, kBlocksI420: a whole sum, which can have undecided samples (see kUndecided).
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
  // The models of the cameras' lenses: pinholes, up to COLMAP's OPENCV, or at least one other model.
  enum class Distortion { kNone, kOpenCv, kGeneral } distortion = Distortion::kNone;
  bool has_cells = false;     // weights come from a WeightGrid instead of the mesh; only for kBlocks

  auto operator<=>(const SumProgram&) const = default;
};
// Markers in a sum for samples that float cannot decide: whether the camera sees the point, or where the sample is (to
// kMaxPositionError). The CPU then computes these samples; see cpu_fixup(). The marker kUndecided is a missing weight,
// and kChromaUndecided a value of Cb. The shaders call them UNDECIDED and CHROMA_UNDECIDED.
inline constexpr int kUndecided = 0xffff, kChromaUndecided = 0x8000;

// The layout of the shaders' buffer `tables`, which contains the geometry of faces and cameras. It has one row for each
// face of the mesh, and a row consists of texels of four floats. Views with a WeightGrid also have a row for each slot,
// with the slot's camera in the first corner.
enum FaceTexel {
  // The anchor of the row. x, y: a pixel, or a line of sight if has_rays; w: a level of the focal map. Positions and
  // inverse distances in the row are relative to the anchor, so that float is precise enough.
  kFaceAnchor,
  kFaceEdge,  // three texels: edge function k is x i + y j + z; w is 1 if the camera in that corner is local
  kFaceCorners = kFaceEdge + 3
};
// Texels of each corner of a face: the camera's projection and image.
enum CornerTexel {
  kCornerFrom,        // ProjectionTerms::from; w: x of the image's offset in the atlas
  kCornerAlong,       // ProjectionTerms::along; w: CornerFlags
  kCornerDown,        // ProjectionTerms::down; w for RGB: byte index of red, + 4 * green, + 16 * blue
  kCornerLens,        // fx, fy, cx, cy
  kCornerDistortion,  // k[0], k[1], p1, p2 of Distortion
  kCornerGeneral,     // k[2], k[3], d[0], d[1]
  kCornerPrism,       // d[2], s1, s2; 1: fisheye
  kCornerSteepness,   // Lens::Steepness: first, rounding; 1 if the lens is_general, otherwise unused
  kCornerImage,       // width and height of the image in pixels, largest squared radius, y of the offset in the atlas
  kCornerTexels,
  // The following texels exist only with a focal map. kCornerPerFrom is ProjectionTerms::per_from; its w is the side of
  // the box for mean luma in pixels, an even number.
  kCornerPerFrom = kCornerTexels,
  kCornerPerAlong,
  kCornerPerDown,
  kMapCornerTexels
};
constexpr int corner_texels(bool has_map) { return has_map ? kMapCornerTexels : kCornerTexels; }
constexpr int face_texels(bool has_map) { return kFaceCorners + 3 * corner_texels(has_map); }
enum CornerFlags { kHasImage = 1 };

// The layout of the header of each view in the shaders' buffer `runs`, in 32-bit words. The headers of all views of the
// pass come first, and then their runs.
enum ViewWord {
  kViewOrigin,       // x, y of the rendered region in the view
  kViewSize = 2,     // size of that region, pixels
  kViewRuns = 4,     // index in `runs` of the view's row table; see kRuns in sum_shader-inl.h
  kViewFaces,        // table row of the view's first face
  kViewLevels,       // first row of the view's focal map in the texture of levels
  kViewNodes,        // columns and rows of the map
  kViewScale = 9,    // MapScale, float
  kViewResult = 13,  // six words with the location of the view's sum; see BlockSum
  kViewCells = 19,   // index of the view's first cell; see make_cells()
  kViewSlots,        // table row of the view's first slot, after its last face; only with cells
  kViewWords
};

// Largest error of a sample position in float, in pixels of the camera image. Samples that may exceed it are undecided.
inline constexpr double kMaxPositionError = 1.0 / 128;
// Relative error of a float after five operations, because each product and sum is good to 2^-24.
inline constexpr double kFloatRounding = 3e-7;
// Largest error of a weight in float.
inline constexpr double kMaxWeightError = 2e-5;
// Least distance of the focal surface from the eye, relative to the numbers that it is computed from. If it is smaller,
// float cannot decide whether the surface is behind the eye.
inline constexpr double kEyeMargin = 1e-5;

// Number of words that describe a camera in a WeightGrid cell. The first word is the camera's table row. Then each
// corner of the cell has a word with two running sums of weights (see WeightGrid), in units of 1 / 32768. The low 16
// bits are the sum without the camera, and the high 16 bits the sum including the camera. For example, 0x60002000 is a
// weight of 1/2.
inline constexpr int kCellWords = 5;

// Bindings of a program's buffers. OpenGL ES 3.1 guarantees only four.
enum BufferBinding {
  kRunsBinding,
  kTablesBinding,
  kResultBinding,
  kSurfacesBinding,
  kPictureBinding = kSurfacesBinding  // unused together
};
// Width and height of a work group of the shaders, in invocations.
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
