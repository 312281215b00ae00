// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <string>

#include "rig/exchange.h"

namespace lf {

// Extends import_stanford(): also chooses parameters that the file names do not contain. Images of parallel cameras
// determine neither the focal length nor, up to scale and shift of inverse depth, the depth. Views from between the
// cameras are the same for any choice. A focal length of 0 in `options` becomes 50 degrees across. A focus distance
// below 0 becomes 0 (unshifted images) if nothing in the images moves against the cameras' motion. Otherwise the
// farthest objects are three times as far away as the nearest (estimate_focus_range()). The notes describe the choice.
RigImport import_stanford_pictures(const std::string& directory, StanfordOptions options);

}  // namespace lf
