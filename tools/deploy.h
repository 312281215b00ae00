// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include "command_line.h"

// Adds the subcommand "deploy" of lf-rig, which writes the configuration of every host from one inventory file
// (docs/reference/files.md).
void add_deploy_command(cli::App& app);
