// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <string>
#include <vector>

namespace lf {

// Collects the log messages of the solver Ceres in memory. Without this call, Ceres prints them on standard error.
// Ceres logs through glog, which is global to the process, so only programs may call this function, not libraries.
void capture_solver_messages();

// Returns at most 16 different messages with their counts, for example "Linear solver failure (3 times)". Thread-safe.
std::vector<std::string> solver_messages();

}  // namespace lf
