// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstdint>
#include <random>
#include <vector>

#include "calibration/board_motion.h"
#include "calibration/solve.h"
#include "rig/rig.h"
#include "scene/calibration_targets.h"

namespace lf::sim {

// A simulated camera array that observes a light or a bar, with the truth; determined by `seed`.
struct ArrayOptions {
  int rows = 8, columns = 8;
  double pitch = 0.06;  // metres
  double f = 420;       // pixels
  int width = 320, height = 240;
  double position_jitter = 0.05;                  // fraction of the pitch, one sigma
  double pointing_jitter = M_PI / 180;            // radians, each axis
  double focal_spread = 0.02, centre_spread = 3;  // relative; pixels
  double k1 = -0.15, k2 = 0.03, k1_spread = 0.01, k2_spread = 0.01;
};

struct PathOptions {
  enum class Shape { kVolume, kPlane, kLine, kBall };  // kBall: radius `near` around the origin, for a ring of cameras
  int positions = 100;
  double near = 0.8, far = 3;  // metres
  Shape shape = Shape::kVolume;
  double bar = 0;                         // metres between two lights; 0: one light
  std::optional<CalibrationBoard> board;  // instead of lights, tilted by up to 0.6 radians
  double noise = 0.2;                     // pixels, x and y each
  double missed = 0, outliers = 0;        // fractions of the observations
};

Rig make_array(const ArrayOptions& options, uint64_t seed);

// Cameras about 2 to 3 m from the origin, facing the origin.
enum class Around { kRing, kDome, kAnywhere };
Rig make_rig_around(Around shape, int count, uint64_t seed);

struct Watched {
  Tracks tracks;
  std::vector<Vec3> lights;  // per position; with a bar, both ends in turn
  std::vector<Pose> boards;  // per position
  Inliers good;              // observations that are not outliers
};
Watched watch(const Rig& truth, const PathOptions& options, uint64_t seed);

// A board that moves before unsynchronised cameras. It visits `positions` poses like in watch(), a second apart,
// and moves past each pose with a random velocity.
struct MovingBoard {
  CalibrationBoard board{.columns = 8, .rows = 5, .square = 0.03};
  int positions = 30;
  double near = 0.35, far = 0.9;  // metres
  double noise = 0.2;             // pixels, x and y each
  double offset = 0;              // seconds; largest time offset of a camera. The offsets become Camera::time_offset
  double drift = 0;               // seconds per second, of odd cameras
  double readout = 0;             // seconds, of the rolling shutters of all cameras
  double speed =
      0.15;          // metres per second, each axis, one sigma; rotations are four times larger, in radians per second
  double rate = 30;  // frames per second
  // False: only the two frames before and after each instant. True: all frames, and the board moves smoothly all the
  // time.
  bool every_frame = false;

  std::vector<double> instants() const;
  Pose pose(double time, const Rig& rig, uint64_t seed) const;  // pose of the board's middle
};
BoardFilms film_board(Rig& truth, const MovingBoard& motion, uint64_t seed);

// Returns the observations of a board as the views of each camera.
BoardSightings sightings_of(const Tracks& tracks, const CalibrationBoard& board);

// Simulated results of Zhang's method for the lenses, with errors of these sigmas; poses are from a nominal grid.
struct LensSigmas {
  double f = 1, c = 1.5, k1 = 0.01, k2 = 0.02;
};
void measure_lenses(const Rig& truth, const LensSigmas& sigmas, uint64_t seed, SolveOptions& options);

// Returns the true scene in the units of adjust(): a bar has length 1.
Reconstruction true_scene(const Rig& truth, const Watched& watched, const SolveOptions& options);

// A grid of unsynchronised cameras 6 cm apart that deviates from its plan: pointing by a degree, positions by a
// twentieth of the pitch, focal lengths by 2 %, k1 = -0.15, clocks by up to 20 ms. Cameras run at 30 and 15 frames/s in
// turn and differ in colour; the last camera's exposure is fixed.
struct PlannedArray {
  PlannedArray(int rows, int columns, int width, int height);

  static constexpr int kFaultSeed = 7;  // for lf-scene --faults

  CameraIndex stuck() const { return static_cast<CameraIndex>(truth.cameras.size() - 1); }
  static double rate_of(CameraIndex camera) { return camera % 2 ? 15 : 30; }
  // Returns the root mean square error of `rig`'s time offsets, up to a common offset; seconds.
  double clock_error(const Rig& rig) const;

  // Returns the PSNR of the built-in scene rendered with `rig` through a focal surface, at a few viewpoints within the
  // array. Each camera contributes the frame nearest to one instant by the rig's offsets, with its faults; the rig's
  // colours are corrected. `rig` is aligned to the truth by the best similarity.
  std::vector<double> shown_db(const Rig& rig) const;
  // Returns the true rig with the colours of `rig`: colours are defined only relative to a mean camera.
  Rig truth_with_colours_of(const Rig& rig) const;

  Rig nominal, truth;
  std::vector<ColourFault> faults;
};

}  // namespace lf::sim
