// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include "command_line.h"

// Adds `difference` to lf-show.
void add_difference_command(cli::App& app);
