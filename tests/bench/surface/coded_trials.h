// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstddef>

#include "focus/camera_trials.h"

namespace lf::focus {

// What a camera's trials become as one grey JPEG of this quality, below one another. Returns the bytes of its scan:
// without tables and markers, which a receiver knows.
size_t code_as_jpeg(int quality, CameraTrials& trials);

}  // namespace lf::focus
