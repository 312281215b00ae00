// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "calibration/board_detection.h"
#include "calibration/solve.h"

namespace lf {

// The views of one board that several cameras see. Views of the same instant show the board in one position.
struct BoardSightings {
  struct Sighting {
    uint32_t camera = 0;   // index into `cameras`
    uint32_t instant = 0;  // below num_instants
    BoardView view;
    std::vector<double> sigmas{};  // Observation::sigma of each corner; empty: 1
  };
  CalibrationBoard board;
  std::vector<Tracks::Camera> cameras;
  size_t num_instants = 0;
  std::vector<Sighting> sightings;
};

// Returns the corners of all sightings as observations, in the same order.
Tracks board_tracks(const BoardSightings& sightings);

// Returns the pose camera_from_board of each sighting; nullopt if it has too few corners. The lenses come from the views
// of each camera alone, as in solve_boards().
std::vector<std::optional<Pose>> board_poses(const BoardSightings& sightings, const SolveOptions& options);

struct BoardSolution {
  Tracks tracks;  // the corners as observations
  Solution solution;
};

// Estimates the poses and the lenses of all cameras from a board that several cameras see. The lens of each camera
// comes from its own views at first (Zhang 2000), unless the prior rig has a measured lens. Views at the same instant
// give relative poses of cameras, which a spanning tree connects. Then one bundle adjustment estimates lenses, cameras
// and boards together. The board's size gives the scale, in metres.
//
// Cameras that share no views with the largest group of cameras stay unused. Throws Error if no two cameras see the
// board at the same instant, or if no camera has enough views for its lens.
BoardSolution solve_boards(const BoardSightings& sightings, const SolveOptions& options);

}  // namespace lf
