// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <string>

#include "rig/exchange.h"

namespace lf {

// Does the same as import_stanford(), and also chooses the focal length and the focus distance. If the file names
// contain the focal length, it is taken from there, and the images are unshifted. Otherwise both are estimated. Images
// of parallel cameras determine neither the focal length nor, up to scale and shift of inverse depth, the depth. Views
// from between the cameras are the same for any choice.
//
// A focal length of 0 in `options` becomes a field of view of 50 degrees across. A focus distance below 0 becomes 0
// (unshifted images) if nothing in the images moves against the cameras' motion. Otherwise the farthest objects are
// taken to be three times as far away as the nearest, which estimate_focus_range() finds. The notes of the result
// describe the choice.
RigImport import_stanford_pictures(const std::string& directory, StanfordOptions options);

}  // namespace lf
