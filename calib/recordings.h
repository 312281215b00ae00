// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <string>

#include "rig/rig.h"

// The path of a camera's recording: NAME.* in `folder` (stills and JSON files beside it are none), or, where that is
// empty, the file that is its source in the rig. Throws lf::Error that says what to do where there is none, or two.
std::string recording_of(const std::string& folder, const lf::Rig& rig, const lf::Camera& camera);

// `rig` with the recordings in `folder` as sources and images, by the names of its cameras: NAME.png and NAME.jpg are
// stills, anything else a video. A camera without one has neither.
lf::Rig recorded_in(const std::string& folder, lf::Rig rig);

// Throws lf::Error where `folder` is not empty and no folder.
void check_folder(const std::string& folder);
