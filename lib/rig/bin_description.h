// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <string>

namespace lf {

// Whether a camera's `source` describes elements ("libcamerasrc camera-name=a ! video/x-raw,width=640") in place of
// naming a URI or a file: it has a "!" between spaces, or begins with "NAME PROPERTY=". Such a rig may run any element
// of this machine, and so any program: only those of the user's own are opened.
bool is_bin_description(const std::string& source);

}  // namespace lf
