// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <string>

#include "rig/rig.h"

namespace lf {

// Throws Error unless the camera's source may be opened. `path` is the file that the rig was read from ("":
// none); a program that opens a copy checks the original.
// - A source that describes elements needs a rig file that only this user and root can write.
// - A source that may do more than give pictures (untrusted_part() in rig/bin_description.h) needs `trusted`: the user
//   has said that this rig may run any element.
void require_trust(const Camera& camera, const std::string& path, bool trusted);
// The same for all cameras of a rig; the error names the camera.
void require_trust(const Rig& rig, const std::string& path, bool trusted);

}  // namespace lf
