// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstddef>
#include <cstdint>

#include "geometry/lens.h"

namespace lf {

// Vectorised functions that project the nodes of depth hypotheses into the image of one camera. They use float, because
// positions are rounded to 1/256 pixel and luma to 8 bits. project_hypothesis() and place_hypotheses() compute
// bit-identical positions.

// The parameters of a CameraProjection in float, as input of these functions.
struct HypothesisProjection {
  // The matrix base + inverse distance x slope maps a line of sight (u, v, 1) to camera coordinates, up to a positive
  // factor. The matrices are row-major.
  float base[9], slope[9];
  float fx, fy, cx, cy;
  Distortion<float> distortion;
  bool is_distorted;
  float width, height;  // size of the camera's image, pixels
  // The inverse distance of a level is farthest + level x per_level. `eye_distance` is the distance of the viewpoint
  // from the reference plane.
  float farthest, per_level, eye_distance;
  int box = 4;  // side of the luma low-pass box, pixels: see box_luma()
};

// The lines of sight (u, v, 1) of `count` nodes. They are NaN for nodes without a line of sight.
struct HypothesisRays {
  const float *u, *v;
  int count;
};

// Number of extra values at the end of arrays "with padding". The functions process whole vectors, so they also read
// and write these values.
inline constexpr size_t kHypothesisPadding = 16;

// Computes where the camera sees the nodes. `levels` are the depths of the nodes. The results are the positions x and y
// in pixels of the image, and `seen`, which is 1 for visible nodes and 0 for all other nodes.
void project_hypothesis(const HypothesisProjection& projection, const HypothesisRays& rays, const uint8_t* levels,
                        float* x, float* y, uint8_t* seen);

// A bounding rectangle of positions. Its right and bottom ends are inclusive, and right < left means empty.
struct PlaceBounds {
  int32_t left = INT32_MAX, top = INT32_MAX, right = -1, bottom = -1;
};

// Computes the positions of the nodes of several hypotheses in a BoxedLuma, as input of the sampling functions.
// Positions are in 1/256 of the distance between values, for example 256 for the second value. Value (0, 0) of the
// image is at (0, 0). Positions beyond the first and last values are clamped, and x is -1 for nodes that are not
// visible.
//
// `levels`, `x` and `y` have one row for each of `num_hypotheses` hypotheses, with rays.count values and padding.
// Returns the bounds of the visible positions.
PlaceBounds place_hypotheses(const HypothesisProjection& projection, const HypothesisRays& rays, const uint8_t* levels,
                             int num_hypotheses, int32_t* x, int32_t* y);

// Computes the weight of one camera, at corner `corner` of a mesh face, at n adjacent nodes of a row inside the face.
// The weight is the edge function of the corner divided by the sum of the three edge functions (see FacePlan). `edge`
// are the functions at the first node, and `step` their increments from node to node. No function may change its sign
// between the nodes. `out` has padding.
//
// The error is at most (6 r + 3) 2^-24, with any instruction set. Here, r is the ratio of the sum at the first node to
// the sum at the evaluated node, but at least 1. It is 1 if the array is parallel to the view. Proof: the first value f
// of a function, its k steps, their product (if it is rounded) and the value g at the k-th node each have a relative
// error of 2^-24. The signs of f and g are equal, so the k steps are at most the larger of them, and the function has
// an error of at most (f + 2 max(f, g) + g) 2^-24. Relative to the sum, the error of the corner's function is (3 r + 1)
// 2^-24. The sum has the same error, multiplied by the weight (at most 1). The quotient is rounded last.
void weigh_run(const double edge[3], const double step[3], int corner, int n, float* out);

}  // namespace lf
