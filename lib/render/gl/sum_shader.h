// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <string>

// The programs that draw sums, in the shading language of OpenGL ES 3.1. What they are given is laid out here, for both
// sides.
namespace lf::gl {

// What a program computes for each of its pixels.
//   kRgb: R, G, B of the sum and the lost weight.
//   kLuma: Y and the lost weight; beside it, which of the face's cameras see what is in focus (bits 0 to 2).
//   kChroma: Cb and Cr, for two by two pixels of what kLuma has drawn.
// All as 16 bits of SumPlanes, modulo 2^16. Where numbers in float can't tell whether a sample is lost, or where it is
// to kMaxPositionError, the lost weight is kDoubt (kLuma: bit 3 is set, too), Cb is kChromaDoubt.
enum class SumProgram { kRgb, kLuma, kChroma };
inline constexpr int kDoubt = 0xffff, kChromaDoubt = 0x8000;

// Numbers in `tables`: texels of four, kTableWidth a row. Of a face, then of a slot after all faces.
inline constexpr int kTableWidth = 256;
enum FaceTexel {
  kFaceAnchor,  // x, y: what pixels (or lines of sight, where these are looked up) of its edges are counted from
  kFaceEdge,    // three: edge function k is x i + y j + z; w: the slot of the camera in that corner, -1: none
  kFaceTexels = kFaceEdge + 3
};
enum SlotTexel {
  kSlotFrom,        // ProjectionTerms::from; w: x of the anchor
  kSlotAlong,       // ProjectionTerms::along; w: y of the anchor
  kSlotDown,        // ProjectionTerms::down; w: SlotFlags
  kSlotPerFrom,     // ProjectionTerms::per_from; w: the level that inverse distances are counted from
  kSlotPerAlong,    // ProjectionTerms::per_along; w: ViewPlan::eye_distance()
  kSlotPerDown,     // ProjectionTerms::per_down; w: the inverse distance of kSlotPerFrom's level
  kSlotLens,        // fx, fy, cx, cy
  kSlotDistortion,  // k1, k2, p1, p2
  kSlotImage,       // the largest squared radius; width, height of the image in pixels; its layer
  kSlotOrder,       // RGB: which byte of a pixel is red, green, blue
  kSlotTexels
};
enum SlotFlags { kHasImage = 1, kIsDistorted = 2, kIsCubic = 4 };

// Pixels of a camera's image that positions may be off by.
inline constexpr double kMaxPositionError = 1.0 / 128;

std::string sum_shader(SumProgram program);
// The text of a vertex shader that draws one triangle over the whole target.
std::string vertex_shader();

}  // namespace lf::gl
