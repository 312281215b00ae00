// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <string>
#include <vector>

#include "image/image.h"
#include "rig/still_image_cache.h"

struct Panel {
  std::string title;
  lf::Image picture;
};

// Draws the images of all cameras side by side. Cameras of a grid keep their rows and columns; other arrays fill an
// almost square mosaic. A large array is reduced to at most 16 x 16 evenly chosen cameras. `width` is the width of the
// mosaic in pixels. If `names` is true, each image is labelled with the camera's name.
lf::Image camera_mosaic(const lf::Rig& rig, const lf::CameraImages& images, int width, bool names = false);

// Writes light text with a dark outline, which is readable on any RGB image. `at` is the left end of the baseline, or
// the centre of the text if `centred` is true. `size` is the approximate height of capitals in pixels.
void write_text(lf::Image& on, const std::string& text, lf::Vec2 at, double size, bool centred = false);
double text_width(const std::string& text, double size);  // pixels

// The labels of a colour bar, which explains the colours of a false-colour picture (lf::heat_colour()). `low` and
// `high` are the values at its ends, `none` is the meaning of grey pixels (lf::kNoValueGrey; omitted if empty), and
// `lines` are further lines of text.
struct ColourBar {
  std::string low, high, none;
  std::vector<std::string> lines;
};
lf::Image with_colour_bar(const lf::Image& picture, const ColourBar& scale);

// Arranges pictures in rows of `columns` panels, with a heading above and a line of text below.
lf::Image make_contact_sheet(const std::string& heading, const std::vector<Panel>& panels, int columns,
                             const std::string& foot);
