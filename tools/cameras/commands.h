// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include "command_line.h"

// Subcommands of lf-rig that open cameras. Each function adds one subcommand to `app`. A subcommand throws lf::Error if
// it fails. Its exit status is 1 if it finds a problem with the cameras.
void add_doctor_command(cli::App& app);
void add_identify_command(cli::App& app);  // the command runs until SIGINT or SIGTERM
void add_lock_command(cli::App& app);
void add_record_command(cli::App& app);
void add_snapshot_command(cli::App& app);
