// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include "command_line.h"

// The steps of lf-rig that open cameras: each adds its subcommand, which sets `status`, the program's
// exit status, where something is wrong that is no error of the program's. What goes wrong else is thrown as lf::Error.
void add_doctor_command(cli::App& app, int& status);
void add_identify_command(cli::App& app);  // runs until a signal comes
void add_lock_command(cli::App& app, int& status);
void add_record_command(cli::App& app, int& status);
void add_snapshot_command(cli::App& app, int& status);
