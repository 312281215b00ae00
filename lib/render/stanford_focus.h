// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <string>

#include "rig/exchange.h"

namespace lf {

// As import_stanford(), where it is not known what the files' names do not tell. Images of cameras that all look the
// same way tell neither focal length nor depth, but for a scale and a shift of the inverse depth: pictures made amid
// the cameras are the same with any. What is chosen: 50 degrees across for a focal length that is 0 in `options`; and
// for a focus distance below 0 that of images as they are where nothing in them goes against the cameras' motion, else
// one with which the farthest things are three times as far away as the nearest (estimate_focus_range()). The notes say
// so.
RigImport import_stanford_pictures(const std::string& directory, StanfordOptions options);

}  // namespace lf
