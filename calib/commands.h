// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <algorithm>
#include <cstdio>
#include <functional>
#include <map>
#include <string>

#include <unistd.h>

#include "command_line.h"
#include "progress.h"
#include "terminal.h"

// Subcommands of lf-calibrate, each implemented in NAME_command.cc (track in solve_command.cc). Each function adds one
// subcommand with its options and callback. A callback throws lf::Error if the command fails.
void add_all_command(cli::App& app);
void add_boards_command(cli::App& app);
void add_check_command(cli::App& app);
void add_colour_command(cli::App& app);
void add_intrinsics_command(cli::App& app);
void add_solve_command(cli::App& app);
void add_track_command(cli::App& app);

// Shows the progress of the solver: a progress bar, or one line per step if standard error is not a terminal. The
// constructor sets `progress` to a function for the options of the solver. This function refers to the object and must
// not be called after its destruction.
class SolveProgress {
 public:
  SolveProgress(const std::string& what, std::function<void(const std::string& step)>& progress) : bar_(what, 100) {
    progress = [this](const std::string& step) { reach(step); };
  }

  void finish() { bar_.finish(); }

 private:
  void reach(const std::string& step) {
    if (!isatty(STDERR_FILENO)) {
      terminal::print_error("%s\n", step.c_str());
      return;
    }
    // The solver runs twice, coarsely and finely, if clocks are estimated. Up to 12 rounds of clock estimation lie in
    // between.
    if (step.starts_with("clocks")) {
      has_clocks_ = true;
      if (step.starts_with("clocks: round")) between_ = std::min(65.0, std::max(between_, 30.0) + 3);
    }
    static const std::map<std::string, double> kShares = {
        {"lens of each camera", 0.02}, {"first layout: boards", 0.1}, {"lenses", 0.15},
        {"distortion", 0.3},           {"final adjustment", 0.7},     {"uncertainty", 0.9}};
    const auto share = kShares.find(step);
    const double in_turn = share == kShares.end() ? 0 : share->second;
    const double from = !has_clocks_ || between_ == 0 ? 0 : between_;
    const double to = !has_clocks_ ? 100 : between_ == 0 ? 30 : 100;
    const bool is_round = step.starts_with("clocks");
    bar_.reach(is_round ? between_ / 100 : (from + in_turn * (to - from)) / 100, step);
  }

  Progress bar_;
  bool has_clocks_ = false;
  double between_ = 0;
};
