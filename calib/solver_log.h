// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <string>
#include <vector>

namespace lf {

// Ceres logs through glog, which writes to stderr unless a program says otherwise. From the first call on glog's
// messages are kept instead. For programs: glog belongs to the whole process.
void catch_solver_messages();

// The messages so far, each text once, with a count: "Linear solver failure (3 times)". At most 16 texts. Thread-safe.
std::vector<std::string> solver_messages();

}  // namespace lf
