// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <string>
#include <vector>

namespace lf {

// Redirects the messages of glog, which Ceres uses, from stderr to memory. For programs only, because glog is global to
// the process.
void capture_solver_messages();

// Returns the messages so far, each text once with its count: "Linear solver failure (3 times)". At most 16 texts.
// Thread-safe.
std::vector<std::string> solver_messages();

}  // namespace lf
