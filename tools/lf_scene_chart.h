// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include "command_line.h"

// lf-scene chart: recordings of a colour chart for a calibration. Returns the command.
cli::App* add_chart_command(cli::App& app);
