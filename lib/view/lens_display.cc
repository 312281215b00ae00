// SPDX-License-Identifier: LGPL-2.1-or-later
#include "view/lens_display.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <vector>

#include "base/error.h"

namespace lf {
namespace {

constexpr int kBand = 16;  // rows of a task

double tangent(const LensDisplay& display) { return std::tan(display.slant * std::numbers::pi / 180); }

// Which of a view's samples lie beside a place along one side of the display, and the part of the second, 256ths.
struct Between {
  int first, second;
  int part;
};
std::vector<Between> stretch(int samples, int pixels) {
  std::vector<Between> out;
  out.reserve(static_cast<size_t>(pixels));
  for (int i = 0; i < pixels; i++) {
    const double at = std::clamp((i + 0.5) * samples / pixels - 0.5, 0., samples - 1.);
    const int first = static_cast<int>(at);
    out.push_back({first, std::min(first + 1, samples - 1), static_cast<int>(std::lround((at - first) * 256))});
  }
  return out;
}

// Places in lenses are fractions of 2^32, so that they wrap as lenses follow each other.
uint64_t in_lenses(double lenses) { return static_cast<uint64_t>(std::llround(std::ldexp(lenses, 32))); }

}  // namespace

double LensDisplay::place(double x, double y) const {
  const double lenses = (x + y * tangent(*this)) / lens_width - centre + 0.5;
  return lenses - std::floor(lenses);
}

void validate(const LensDisplay& display) {
  if (!(display.lens_width > 0) || !std::isfinite(display.lens_width))
    throw Error("lenses: their width must be positive");
  if (!(std::abs(display.slant) < 90)) throw Error("lenses: their slant must be less than 90 degrees");
  if (!std::isfinite(display.centre)) throw Error("lenses: their centre is not finite");
}

void interleave(const LensDisplay& display, const Quilt& quilt, int width, int height, ptrdiff_t stride, uint8_t* out,
                const ParallelFor& parallel) {
  validate(display);
  const ImageView& picture = quilt.picture;
  const int view_width = picture.width / quilt.columns, view_height = picture.height / quilt.rows;
  const std::vector<Between> across = stretch(view_width, width), down = stretch(view_height, height);
  const RgbLayout& layout = picture.layout;
  const int channels[3] = {layout.r, layout.g, layout.b};
  const auto views = static_cast<uint64_t>(quilt.count());
  std::vector<const uint8_t*>
      corners;  // top left sample of each view, in the order that they are seen in from lens to lens
  for (int k = 0; k < quilt.count(); k++) {
    const int view = display.reversed ? k : quilt.count() - 1 - k;
    const int column = view % quilt.columns, row = quilt.rows - 1 - view / quilt.columns;
    corners.push_back(picture.plane[0] + ptrdiff_t{row} * view_height * picture.stride[0] +
                      ptrdiff_t{column} * view_width * layout.pixel_stride);
  }
  const uint64_t step = in_lenses(1 / (3 * display.lens_width));
  const auto row = [&](int y) {
    const double from_middle = y - (height - 1) / 2.0;
    uint64_t place = in_lenses(display.place(-(width - 1) / 2.0 - 1. / 3, from_middle));
    const auto [upper, lower, below] = down[y];
    const ptrdiff_t upper_row = upper * picture.stride[0], lower_row = lower * picture.stride[0];
    uint8_t* to = out + y * stride;
    for (int x = 0; x < width; x++) {
      const ptrdiff_t left = ptrdiff_t{across[x].first} * layout.pixel_stride;
      const ptrdiff_t right = ptrdiff_t{across[x].second} * layout.pixel_stride;
      const int part = across[x].part;
      for (int c = 0; c < 3; c++, place += step) {
        const uint8_t* const view = corners[(place & 0xFFFFFFFFu) * views >> 32] + channels[c];
        const int top = view[upper_row + left] * (256 - part) + view[upper_row + right] * part;
        const int bottom = view[lower_row + left] * (256 - part) + view[lower_row + right] * part;
        *to++ = static_cast<uint8_t>((top * (256 - below) + bottom * below + (1 << 15)) >> 16);
      }
    }
  };
  parallel(static_cast<size_t>((height + kBand - 1) / kBand), [&](size_t band) {
    const int first = static_cast<int>(band) * kBand;
    for (int y = first; y < std::min(first + kBand, height); y++) row(y);
  });
}

}  // namespace lf
