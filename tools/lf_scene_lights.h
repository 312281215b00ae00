// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include "command_line.h"

// lf-scene lights: recordings of a moving light or bar for a calibration, with the truth beside. Returns the command.
cli::App* add_lights_command(cli::App& app);
