// SPDX-License-Identifier: LGPL-2.1-or-later
#include "image/heat_map.h"

#include <algorithm>
#include <cmath>

#include "base/error.h"

namespace lf {
namespace {

using Colour = std::array<uint8_t, 3>;

// At 0, 0.1, ..., 1; in between linear.
constexpr std::array<Colour, 11> kScale{{{0, 0, 4},
                                         {22, 11, 57},
                                         {66, 10, 104},
                                         {106, 23, 110},
                                         {147, 38, 103},
                                         {188, 55, 84},
                                         {221, 81, 58},
                                         {243, 120, 25},
                                         {252, 165, 10},
                                         {246, 215, 70},
                                         {252, 255, 164}}};

double luma(const uint8_t* rgb) { return 0.299 * rgb[0] + 0.587 * rgb[1] + 0.114 * rgb[2]; }

}  // namespace

std::array<uint8_t, 3> heat_colour(double share) {
  const double at = std::clamp(share, 0.0, 1.0) * (kScale.size() - 1);
  const size_t lower = std::min(static_cast<size_t>(at), kScale.size() - 2);
  const double t = at - static_cast<double>(lower);
  Colour colour;
  for (size_t c = 0; c < 3; c++)
    colour[c] = static_cast<uint8_t>(std::lround((1 - t) * kScale[lower][c] + t * kScale[lower + 1][c]));
  return colour;
}

Image heat_map(std::span<const float> values, int width, int height, double full, const Image* underlay) {
  Image map(PixelFamily::kRgb, width, height);
  const auto fits = [&](const Image& image) {
    return image.family() == PixelFamily::kRgb && image.width() == width && image.height() == height;
  };
  if (values.size() * 3 != map.data().size() || (underlay && !fits(*underlay)))
    throw Error("a heat map and what is under it must be of one size");
  for (size_t i = 0; i < values.size(); i++) {
    uint8_t* const out = &map.data()[3 * i];
    if (std::isnan(values[i])) {
      std::fill_n(out, 3, kNoHeat);
      continue;
    }
    const double share = std::clamp(values[i] / full, 0.0, 1.0);
    const Colour colour = heat_colour(share);
    const double through = underlay ? kHeatUnderlay * (1 - share) * luma(&underlay->data()[3 * i]) : 0;
    for (size_t c = 0; c < 3; c++) out[c] = static_cast<uint8_t>(std::min(255.0, colour[c] + through + 0.5));
  }
  return map;
}

}  // namespace lf
