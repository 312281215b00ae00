// SPDX-License-Identifier: LGPL-2.1-or-later
#include "image/sharpen.h"

#include <algorithm>
#include <cmath>

namespace lf {
namespace {

constexpr int kFractionBits = 8;
constexpr int kNeighbour = static_cast<int>(kSharpening * (1 << kFractionBits) / 4 + 0.5);  // of each neighbour
constexpr int kMiddle = (1 << kFractionBits) + 4 * kNeighbour;

inline uint8_t sharpened(int at, int around) {
  const int v = (kMiddle * at - kNeighbour * around + (1 << (kFractionBits - 1))) >> kFractionBits;
  return static_cast<uint8_t>(std::clamp(v, 0, 255));
}

// A channel of a plane of width x height samples that are `step` bytes apart, to samples `out_step` bytes apart.
void sharpen_channel(const uint8_t* plane, ptrdiff_t stride, int step, int width, int height, const Rect& rect,
                     uint8_t* out, ptrdiff_t out_stride, int out_step) {
  for (int y = rect.y0; y < rect.y1; y++) {
    const uint8_t* const row = plane + y * stride;
    const uint8_t* const above = plane + std::max(y - 1, 0) * stride;
    const uint8_t* const below = plane + std::min(y + 1, height - 1) * stride;
    uint8_t* const to = out + y * out_stride;
    const auto at = [&](int x, int left, int right) {
      to[x * out_step] = sharpened(row[x * step], row[left * step] + row[right * step] + above[x * step] +
                                                      below[x * step]);
    };
    const int first = std::max(rect.x0, 1), last = std::min(rect.x1, width - 1);
    if (rect.x0 == 0) at(0, 0, std::min(1, width - 1));
    for (int x = first; x < last; x++) at(x, x - 1, x + 1);
    if (rect.x1 == width && width > 1) at(width - 1, width - 2, width - 1);
  }
}

}  // namespace

void sharpen(const ImageView& image, const Rect& rect, Image& out) {
  if (out.family() != image.family || out.width() != image.width || out.height() != image.height)
    out = Image(image.family, image.width, image.height);
  uint8_t* const to = out.data().data();
  if (image.family == PixelFamily::kRgb) {
    const int offset[3] = {image.layout.r, image.layout.g, image.layout.b};
    for (int c = 0; c < 3; c++)
      sharpen_channel(image.plane[0] + offset[c], image.stride[0], image.layout.pixel_stride, image.width,
                      image.height, rect, to + c, ptrdiff_t{3} * image.width, 3);
    return;
  }
  const int chroma_width = chroma_size(image.width), chroma_height = chroma_size(image.height);
  sharpen_channel(image.plane[0], image.stride[0], 1, image.width, image.height, rect, to, image.width, 1);
  const Rect half{rect.x0 / 2, rect.y0 / 2, chroma_size(rect.x1), chroma_size(rect.y1)};
  uint8_t* chroma = to + static_cast<size_t>(image.width) * image.height;
  for (int c = 1; c < 3; c++, chroma += static_cast<size_t>(chroma_width) * chroma_height)
    sharpen_channel(image.plane[c], image.stride[c], 1, chroma_width, chroma_height, half, chroma, chroma_width, 1);
}

}  // namespace lf
