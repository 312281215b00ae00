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
// At most 16 x 16 of them, evenly chosen. `width`: of the mosaic, pixels. `names`: whether each camera's is written
// into its picture.
lf::Image camera_mosaic(const lf::Rig& rig, const lf::CameraImages& images, int width, bool names = false);

// Writes light text with a dark border on a picture, RGB, so that it can be read on all of them. `at`: the left end of
// its base line, or its middle with `centred`. `size`: about the height of a capital, pixels.
void write_text(lf::Image& on, const std::string& text, lf::Vec2 at, double size, bool centred = false);
double text_width(const std::string& text, double size);  // pixels

// A picture above a scale of lf::heat_colour(), with what its ends mean, a square of lf::kNoHeat with what that means
// (left out where it is empty), and lines of text.
struct HeatScale {
  std::string low, high, none;
  std::vector<std::string> lines;
};
lf::Image with_scale(const lf::Image& picture, const HeatScale& scale);

// A contact sheet: `columns` panels a row under a heading, each with its title and scaled into one size, and a line of
// text at the foot.
lf::Image make_sheet(const std::string& heading, const std::vector<Panel>& panels, int columns,
                     const std::string& foot);
