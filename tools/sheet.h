// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <string>
#include <vector>

#include "image/image.h"
#include "rig/still_images.h"

// One picture of a contact sheet, of any size.
struct Panel {
  std::string title;
  lf::Image picture;  // RGB
};

// The cameras' images side by side as they stand in the rig: rows and columns of a grid, else as square as it gets.
// At most 16 x 16 of them, evenly chosen. `width`: of the mosaic, pixels.
lf::Image camera_mosaic(const lf::Rig& rig, const lf::CameraImages& images, int width);

// A contact sheet: `columns` panels a row under a heading, each with its title and scaled into one size, and a line of
// text at the foot.
lf::Image make_sheet(const std::string& heading, const std::vector<Panel>& panels, int columns,
                     const std::string& foot);
