// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <string>
#include <vector>

#include "image/image.h"
#include "rig/still_image_cache.h"

struct Panel {
  std::string title;
  lf::Image picture;  // RGB
};

// Arranges the camera images like the array: in the grid's rows and columns, otherwise nearly square. Shows at most 16
// x 16 evenly chosen images. `width`: width of the mosaic, pixels. `names`: write each camera's name into its image.
lf::Image camera_mosaic(const lf::Rig& rig, const lf::CameraImages& images, int width, bool names = false);

// Writes light text with a dark outline, readable on any RGB image. `at`: left end of the baseline, or the centre of
// the text if `centred`. `size`: approximate height of capitals, pixels.
void write_text(lf::Image& on, const std::string& text, lf::Vec2 at, double size, bool centred = false);
double text_width(const std::string& text, double size);  // pixels

// Labels of a colour bar: both ends of the lf::heat_colour() scale, the meaning of lf::kNoValueGrey (omitted if empty),
// and additional lines of text.
struct ColourBar {
  std::string low, high, none;
  std::vector<std::string> lines;
};
lf::Image with_colour_bar(const lf::Image& picture, const ColourBar& scale);

// Returns a contact sheet with `columns` panels per row, all scaled to one size, a heading and a footer.
lf::Image make_contact_sheet(const std::string& heading, const std::vector<Panel>& panels, int columns,
                             const std::string& foot);
