// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <string>
#include <vector>

#include "rig/rig.h"

// Recordings of a folder are files NAME.*, NAME being the camera's. Their content decides what they are, not the ending
// of their names: cameras and recorders leave thumbnails, time codes, subtitles and sound beside their films. A file of
// several JPEG pictures is a film. gst_init() must have been called.

// The path of a camera's film in `folder` or, where that is empty, the file that is its source in the rig. Throws
// lf::Error that says what to do where there is none, or two.
std::string recording_of(const std::string& folder, const lf::Rig& rig, const lf::Camera& camera);

// `rig` with the films in `folder` as sources and the stills as images. A camera without one has neither. Throws
// lf::Error where a camera has two films, or no film and two stills.
lf::Rig recorded_in(const std::string& folder, lf::Rig rig);

// The pictures of a board that a camera took: all stills in the folder NAME of `folder`, in natural order, or else the
// URI of the film NAME.* as the only element, or nothing. Throws lf::Error where there are two films.
std::vector<std::string> boards_in(const std::string& folder, const lf::Camera& camera);

// Throws lf::Error where `folder` is not empty and no folder.
void check_folder(const std::string& folder);
