// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstddef>
#include <cstdint>

namespace lf {

// These functions find where one camera looks for nodes of trials, many at a time. They compute in float, as positions
// are rounded to 256ths of a pixel and luma to 8 bits anyway; project_trial() and place_trials() find the same
// positions, to the bit.

// How a camera projects: CameraProjection in float.
struct TrialProjection {
  // Line of sight (u, v, 1) to camera coordinates, row-major: base + inverse distance x slope, up to a positive factor.
  float base[9], slope[9];
  float fx, fy, cx, cy, k1, k2, p1, p2;
  bool distorted;
  float max_r2;         // largest r^2 of undistorted coordinates that the lens shows
  float width, height;  // of the camera's image, pixels
  // Inverse distance = farthest + level x per_level; the eye is at `eye_distance`.
  float farthest, per_level, eye_distance;
  int box = 4;  // side, pixels, of the box that luma is low-passed by before it is sampled, see box_luma()
};

// Lines of sight (u, v, 1) of nodes; NaN where there is none.
struct TrialRays {
  const float *u, *v;
  int count;
};

// Functions whose arrays have `spare` values read and write so many of no meaning behind those of the nodes, too.
inline constexpr size_t kTrialSpare = 16;

// The nodes' positions in the image, pixels, and whether anything is seen there (0 or 1). `levels`: of the nodes.
void project_trial(const TrialProjection& projection, const TrialRays& rays, const uint8_t* levels, float* x, float* y,
                   uint8_t* seen);

// A rectangle of positions, both ends inside. Nothing: right < left.
struct PlaceBounds {
  int32_t left = INT32_MAX, top = INT32_MAX, right = -1, bottom = -1;
};

// Positions of `num_trials` trials, as places among a BoxedLuma's values, 256ths: value (0, 0) of the image is at (0,
// 0), and what lies beyond the first and last ones is at these. x = -1 where nothing is seen. All arrays are rows of
// rays.count values and `spare`, one for each trial but in `rays`. Returns where the seen ones of all trials are.
PlaceBounds place_trials(const TrialProjection& projection, const TrialRays& rays, const uint8_t* levels,
                         int num_trials, int32_t* x, int32_t* y);

// The weight of corner `corner` in n nodes of a face: the part that its edge function has of the sum of the three.
// `edge`: the functions at the first node, `step`: from one to the next; of one sign in all of the nodes. `out` has
// `spare` values.
//
// Bound, with any instruction set: (6 r + 3) 2^-24, where r is how many times as large the sum is at the first node as
// at the one that is asked for, at least 1; it is 1 where the array is parallel to the view. Because: a function's
// value f at the first node, its k steps, their product (if it is rounded at all) and the value g at the k-th node are
// each rounded to a part of 2^-24; f and g are of one sign, so that k steps are no more than the larger of them; so
// each function is off by (f + 2 max(f, g) + g) 2^-24 at most. Of the corner's function that is (3 r + 1) 2^-24 of the
// sum, of the sum as much, by which the weight (at most 1) is off once more; the quotient is rounded last.
void weigh_run(const double edge[3], const double step[3], int corner, int n, float* out);

}  // namespace lf
