// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstdint>

// The inner loops of trials: one camera, one row of nodes. All in float, as positions are rounded to 256ths of a pixel
// and luma to 8 bits anyway; both of the functions that project find the same positions, to the bit.
namespace lf {

// Where a camera looks, CameraProjection in float.
struct TrialProjection {
  // Line of sight (u, v, 1) to camera coordinates, row-major: base + inverse distance x slope, up to a positive factor.
  float base[9], slope[9];
  float fx, fy, cx, cy, k1, k2, p1, p2;
  bool distorted;
  float max_r2;         // of undistorted coordinates: beyond, the lens shows nothing
  float width, height;  // of its image, pixels
  // Inverse distance = farthest + level x per_level; the eye is at `eye_distance`.
  float farthest, per_level, eye_distance;
};

// Nodes [first, end) of a row of `columns`: what belongs to nodes are pointers to the row's first.
struct TrialNodes {
  const float *u, *v;   // lines of sight
  const float* weight;  // the camera's; of no meaning outside
  int first, end, columns;
};

// Values of a BoxedLuma: that of (x, y) in the image is at (x - left, y - top), bilinear.
struct TrialLuma {
  const uint8_t* values;
  float left, top;
  int32_t width, height;
};

// Of one trial.
struct TrialSums {
  const uint8_t* levels;
  uint16_t *weight, *luma, *square;  // see Moments
};

// Positions in the image, and whether anything is seen there (0 or 1).
void project_trial(const TrialProjection& projection, const TrialNodes& nodes, const uint8_t* levels, float* x,
                   float* y, uint8_t* seen);

// Adds what is seen there of `luma` to the sums of every trial.
void add_trials(const TrialProjection& projection, const TrialNodes& nodes, const TrialLuma& luma,
                const TrialSums* trials, int num_trials);

// The weight of corner `corner` in n nodes of a face. `edge`: its edge functions at the first, `step`: from one to the
// next.
void weigh_run(const double edge[3], const double step[3], int corner, int n, float* out);

}  // namespace lf
