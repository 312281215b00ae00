// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <string>

#include <nlohmann/json_fwd.hpp>

#include "rig/rig.h"

// What the monitor of a running lf-serve says of a rig's cameras, as check_report() of rig_check.h has it: "from" is
// "monitor"; cameras have "id", "name", "state" (holds, moved, colour, picture or unknown), "shift_px" and "gain".
// `place`: the server's address, or a file with its monitor.json. `token_file`: of its bearer token; may be empty.
// Throws lf::Error where there is no answer, or it is of other cameras.
nlohmann::json check_monitor(const lf::Rig& rig, const std::string& place, const std::string& token_file);
