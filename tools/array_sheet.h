// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <string>

#include "image/image.h"
#include "rig/rig.h"

// Draws a contact sheet of a rig: the images of its cameras, the home view (the first view of every viewer), and plans
// of the array from behind and from above, with the camera mesh, the viewing directions and a scale. Uses stills and
// the first pictures of sequences. A rig without such pictures gets only the plans. Throws lf::Error for a damaged
// picture.
lf::Image array_sheet(const lf::Rig& rig, const std::string& heading);
