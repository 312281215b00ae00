// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstddef>
#include <cstdint>

namespace lf {

// Projection of many nodes of hypotheses into one camera. Computed in float, as positions are rounded to 256ths of a
// pixel and luma to 8 bits. project_hypothesis() and place_hypotheses() find bit-identical positions.

// CameraProjection in float.
struct HypothesisProjection {
  // Line of sight (u, v, 1) to camera coordinates, up to a positive factor: base + inverse distance x slope; row-major.
  float base[9], slope[9];
  float fx, fy, cx, cy, k1, k2, p1, p2;
  bool distorted;
  float max_r2;         // largest valid r^2 of undistorted coordinates
  float width, height;  // size of the camera's image, pixels
  // Inverse distance = farthest + level x per_level. The viewpoint is at `eye_distance` from the reference plane.
  float farthest, per_level, eye_distance;
  int box = 4;  // side of the luma low-pass box, pixels: see box_luma()
};

// Lines of sight (u, v, 1) of nodes; NaN where there is none.
struct HypothesisRays {
  const float *u, *v;
  int count;
};

// Number of unused values at the end of arrays "with padding". The functions read and write the padding.
inline constexpr size_t kHypothesisPadding = 16;

// Computes the nodes' positions in the image, pixels, and visibility (0 or 1). `levels`: of the nodes.
void project_hypothesis(const HypothesisProjection& projection, const HypothesisRays& rays, const uint8_t* levels,
                        float* x, float* y, uint8_t* seen);

// Bounding rectangle of positions, both ends inclusive. Empty: right < left.
struct PlaceBounds {
  int32_t left = INT32_MAX, top = INT32_MAX, right = -1, bottom = -1;
};

// Computes the positions of `num_hypotheses` hypotheses among the values of a BoxedLuma, in 256ths. Value (0, 0) of the
// image is at (0, 0); positions beyond the first and last values are clamped. x = -1: not visible. Arrays have a row of
// rays.count values with padding for each hypothesis; `rays` has one row. Returns the bounds of the visible positions.
PlaceBounds place_hypotheses(const HypothesisProjection& projection, const HypothesisRays& rays, const uint8_t* levels,
                             int num_hypotheses, int32_t* x, int32_t* y);

// Computes the weight of corner `corner` at n nodes of a face: its edge function divided by the sum of the three.
// `edge`: the functions at the first node. `step`: their increments from node to node. All functions have the same sign
// at all nodes. `out` has padding.
//
// Error bound, with any instruction set: (6 r + 3) 2^-24. r is the ratio of the sum at the first node to the sum at the
// evaluated node, at least 1; it is 1 if the array is parallel to the view. Proof: a function's value f at the first
// node, its k steps, their product (if it is rounded) and the value g at the k-th node each have a relative error of
// 2^-24. f and g have the same sign, so the k steps are at most the larger of them, and the function is off by at most
// (f + 2 max(f, g) + g) 2^-24. Relative to the sum, the corner's function is off by (3 r + 1) 2^-24. The sum is off by
// as much, multiplied by the weight (at most 1). The quotient is rounded last.
void weigh_run(const double edge[3], const double step[3], int corner, int n, float* out);

}  // namespace lf
