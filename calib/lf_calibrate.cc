// SPDX-License-Identifier: LGPL-2.1-or-later
// lf-calibrate: measures the cameras of an array, step by step.
#include "command_line.h"
#include "commands.h"

int main(int argc, char** argv) {
  cli::App app("Measures the cameras of an array: lenses, positions, orientations, each with its uncertainty",
               "lf-calibrate");
  app.require_subcommand(1);
  add_features_command(app);
  add_intrinsics_command(app);
  add_solve_command(app);
  return cli::run_tool(app, argc, argv, [] {});
}
