// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <string>

#include "rig/rig.h"

// Where the recording of a camera is: NAME.* in `folder` (stills and JSON files beside it are none), or, where that is
// empty, the file that is its source in the rig. Throws lf::Error that says what to do where there is none, or two.
std::string recording_of(const std::string& folder, const lf::Rig& rig, const lf::Camera& camera);

// Throws lf::Error where `folder` (which may be empty) is not one.
void check_folder(const std::string& folder);
