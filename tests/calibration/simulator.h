// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstdint>
#include <random>
#include <vector>

#include "calibration/solve.h"
#include "rig/rig.h"
#include "scene/calibration_targets.h"

namespace lf::sim {

// An array of cameras on a board that watches a light or a bar, with the truth beside: everything follows from `seed`.
struct ArrayOptions {
  int rows = 8, columns = 8;
  double pitch = 0.06;  // metres
  double f = 420;       // pixels
  int width = 320, height = 240;
  double position_jitter = 0.05;                  // of the pitch, one sigma
  double pointing_jitter = M_PI / 180;            // radians, each axis
  double focal_spread = 0.02, centre_spread = 3;  // relative; pixels
  double k1 = -0.15, k2 = 0.03, k1_spread = 0.01, k2_spread = 0.01;
};

struct PathOptions {
  enum class Shape { kVolume, kPlane, kLine, kBall };  // kBall: within `near` of the origin, for cameras around it
  int positions = 100;
  double near = 0.8, far = 3;  // metres
  Shape shape = Shape::kVolume;
  double bar = 0;                   // metres between two lights; 0: one light
  double noise = 0.2;               // pixels, x and y each
  double missed = 0, outliers = 0;  // shares of the observations
};

Rig make_array(const ArrayOptions& options, uint64_t seed);

// Cameras 2 to 3 m from the origin that look at it, about.
enum class Around { kRing, kDome, kAnywhere };
Rig make_rig_around(Around shape, int count, uint64_t seed);

struct Watched {
  Tracks tracks;
  std::vector<Vec3> lights;  // of each position, or of both ends of the bar there in turn
  Inliers good;              // observations that are not outliers
};
Watched watch(const Rig& truth, const PathOptions& options, uint64_t seed);

// What Zhang's step would have said of the lenses, with errors as large as it says; poses are those of a nominal grid.
struct LensSigmas {
  double f = 1, c = 1.5, k1 = 0.01, k2 = 0.02;
};
void measure_lenses(const Rig& truth, const LensSigmas& sigmas, uint64_t seed, SolveOptions& options);

// The scene at the truth, as adjust() has it: bars are the unit of length.
Reconstruction true_scene(const Rig& truth, const Watched& watched, const SolveOptions& options);

// A grid of cameras 6 cm apart that came out otherwise than it was planned, and that runs freely: pointing off by a
// degree, positions by a twentieth of the pitch, focal lengths by 2 %, k1 = -0.15, clocks by up to 20 ms; cameras film
// at 30 and 15 frames a second in turn, with colours of their own, and the last one's exposure is stuck.
struct PlannedArray {
  PlannedArray(int rows, int columns, int width, int height);

  static constexpr int kFaultSeed = 7;  // for lf-scene --faults

  CameraIndex stuck() const { return static_cast<CameraIndex>(truth.cameras.size() - 1); }
  static double rate_of(CameraIndex camera) { return camera % 2 ? 15 : 30; }
  // Root mean square of `rig`'s time offsets less the true ones, less what all have in common; seconds.
  double clock_error(const Rig& rig) const;

  // PSNR of what the array shows of the built-in scene, through a focal surface, where it is taken for `rig`, of each
  // of a few eyes amid the array. Each camera gives the frame that is nearest to one instant by the rig's offsets, with
  // its faults; the rig's colours are corrected, and `rig` is laid over the truth by the similarity that fits best.
  std::vector<double> shown_db(const Rig& rig) const;
  // The truth with the colours of `rig`, since there are no true ones beside those of a mean camera.
  Rig truth_with_colours_of(const Rig& rig) const;

  Rig nominal, truth;
  std::vector<ColourFault> faults;
};

}  // namespace lf::sim
