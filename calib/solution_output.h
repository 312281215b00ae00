// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <string>
#include <vector>

#include <nlohmann/json.hpp>

#include "calibration/board_motion.h"
#include "calibration/moving_light.h"
#include "commands.h"

// The result of a calibration of poses and lenses, from lights or from boards.
struct SolvedCameras {
  const lf::Solution& solution;
  const lf::Tracks& tracks;
  const lf::SolveOptions& options;
  lf::PlacementOptions placement{};
  const lf::LightSolution* lights = nullptr;        // the clocks, if the tracks come from a light,
  const lf::MovingBoardSolution* boards = nullptr;  // or from films of a board
  std::vector<std::string> names;                   // names of the cameras if there is no prior rig; may be empty
};

// Reads the rig file of --prior into `options`. Returns the parsed file, as `original` of save_solution().
nlohmann::json load_prior(const std::string& path, lf::SolveOptions& options);

// Places the cameras, writes them to the rig file `out` and the report to the file `report` (unless empty), and prints
// a summary. The rig file keeps the other members of `original`: the prior rig file, or an empty object. `program` is
// recorded as the origin. Throws lf::Error if cameras are missing; the rig has been written then.
void save_solution(const SolvedCameras& solved, nlohmann::json original, const std::string& program,
                   const std::string& out, const std::string& report, SolveProgress& progress);
