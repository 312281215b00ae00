// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include "command_line.h"

// The large steps of lf-calibrate, NAME_command.cc: each adds its subcommand with options and a callback that runs it.
// What goes wrong is thrown as lf::Error; `status`: the exit status of what can end otherwise than well without that.
void add_all_command(cli::App& app, int& status);
void add_check_command(cli::App& app, int& status);
void add_colour_command(cli::App& app);
void add_intrinsics_command(cli::App& app);
void add_report_command(cli::App& app);
void add_solve_command(cli::App& app);
void add_track_command(cli::App& app);
