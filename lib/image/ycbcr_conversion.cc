// SPDX-License-Identifier: LGPL-2.1-or-later
#include "image/ycbcr_conversion.h"

#include <algorithm>
#include <cmath>
#include <vector>

namespace lf {
namespace {

constexpr double kOne = 1 << 16;
constexpr int32_t kHalf = 1 << 15;
constexpr int kSixteenths = 16;  // of an input level, in which chroma is taken between samples

uint8_t to_level(int32_t value) { return static_cast<uint8_t>(std::clamp((value + kHalf) >> 16, 0, 255)); }

int32_t rounded(double value) { return static_cast<int32_t>(std::lround(value)); }

}  // namespace

YcbcrConversion::YcbcrConversion(const YcbcrKind& from) : from_(from) {
  constexpr YcbcrKind kOwn;
  const double zero = from.full_range ? 0 : 16, luma = 255. / (from.full_range ? 255 : 219);
  for (int y = 0; y < 256; y++) luma_[y] = rounded((y - zero) * luma * kOne);
  // R - Y, G - Y and B - Y for a Cb or Cr of 1, and what these make of luma by the own weights.
  const double kg = 1 - from.kr - from.kb, own_kg = 1 - kOwn.kr - kOwn.kb;
  const double blue = 2 * (1 - from.kb), red = 2 * (1 - from.kr);
  const double of_cb = kOwn.kb * blue - own_kg * from.kb * blue / kg;
  const double of_cr = kOwn.kr * red - own_kg * from.kr * red / kg;
  const double level = 255. / (from.full_range ? 255 : 224) * kOne / kSixteenths;
  luma_of_[0] = rounded(of_cb * level);
  luma_of_[1] = rounded(of_cr * level);
  const double own_blue = 2 * (1 - kOwn.kb), own_red = 2 * (1 - kOwn.kr);
  chroma_of_[0][0] = rounded((blue - of_cb) / own_blue * level);
  chroma_of_[0][1] = rounded(-of_cr / own_blue * level);
  chroma_of_[1][0] = rounded(-of_cb / own_red * level);
  chroma_of_[1][1] = rounded((red - of_cr) / own_red * level);
}

// Sixteenths of levels away from the middle, at the middles of 2 x 2 pixels.
void YcbcrConversion::sited_row(const ImageView& in, int plane, int y, int32_t* out) const {
  const int width = chroma_size(in.width), height = chroma_size(in.height);
  const uint8_t* const upper = in.plane[plane] + y * in.stride[plane];
  const uint8_t* const lower = in.plane[plane] + std::min(y + 1, height - 1) * in.stride[plane];
  // A sample half a pixel before the middle is a quarter of the way back to it: the next one has a quarter of the say.
  const int below = from_.down < 0 ? 1 : 0, beside = from_.right < 0 ? 1 : 0;
  for (int x = 0; x < width; x++) {
    const int next = std::min(x + 1, width - 1);
    const int left = upper[x] * (4 - below) + lower[x] * below;
    const int right = upper[next] * (4 - below) + lower[next] * below;
    out[x] = left * (4 - beside) + right * beside - 128 * kSixteenths;
  }
}

void YcbcrConversion::convert(const ImageView& in, uint8_t* const out[3], const ptrdiff_t stride[3]) const {
  const int width = chroma_size(in.width), height = chroma_size(in.height);
  std::vector<int32_t> row(size_t{3} * width);
  int32_t *const cb = row.data(), *const cr = cb + width, *const more = cr + width;
  for (int y = 0; y < height; y++) {
    sited_row(in, 1, y, cb);
    sited_row(in, 2, y, cr);
    uint8_t* const out_cb = out[1] + y * stride[1];
    uint8_t* const out_cr = out[2] + y * stride[2];
    constexpr int32_t kMiddle = 128 << 16;
    for (int x = 0; x < width; x++) {
      out_cb[x] = to_level(kMiddle + cb[x] * chroma_of_[0][0] + cr[x] * chroma_of_[0][1]);
      out_cr[x] = to_level(kMiddle + cb[x] * chroma_of_[1][0] + cr[x] * chroma_of_[1][1]);
      more[x] = cb[x] * luma_of_[0] + cr[x] * luma_of_[1];
    }
    for (int j = 2 * y; j < std::min(2 * y + 2, in.height); j++) {
      const uint8_t* const luma = in.plane[0] + j * in.stride[0];
      uint8_t* const to = out[0] + j * stride[0];
      for (int x = 0; x < in.width; x++) to[x] = to_level(luma_[luma[x]] + more[x / 2]);
    }
  }
}

}  // namespace lf
