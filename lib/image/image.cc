// SPDX-License-Identifier: LGPL-2.1-or-later
#include "image/image.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "base/text.h"
#include "image/image_filters.h"

namespace lf {
namespace {

uint8_t to_byte(double v) { return static_cast<uint8_t>(std::clamp(std::lround(v), 0L, 255L)); }

}  // namespace

size_t packed_size(PixelFamily family, int width, int height) {
  const size_t luma = static_cast<size_t>(width) * height;
  switch (family) {
    case PixelFamily::kRgb: return luma * 3;
    case PixelFamily::kI420: return luma + 2 * static_cast<size_t>(chroma_size(width)) * chroma_size(height);
    case PixelFamily::kNone: break;
  }
  return 0;
}

Image::Image(PixelFamily family, int width, int height)
    : family_(family), width_(width), height_(height), data_(packed_size(family, width, height)) {}

size_t Image::plane_offset(int i) const {
  if (i == 0) return 0;
  const size_t luma = static_cast<size_t>(width_) * height_;
  const size_t chroma = static_cast<size_t>(chroma_size(width_)) * chroma_size(height_);
  return luma + (i - 1) * chroma;
}

ImageView Image::view() const {
  ImageView v;
  v.family = family_;
  v.width = width_;
  v.height = height_;
  if (family_ == PixelFamily::kRgb) {
    v.plane[0] = data_.data();
    v.stride[0] = static_cast<ptrdiff_t>(width_) * 3;
  } else if (family_ == PixelFamily::kI420) {
    for (int i = 0; i < 3; i++) {
      v.plane[i] = plane(i);
      v.stride[i] = i == 0 ? width_ : chroma_size(width_);
    }
  }
  return v;
}

Image to_i420(const Image& rgb) {
  Image out(PixelFamily::kI420, rgb.width(), rgb.height());
  const int w = rgb.width(), h = rgb.height(), cw = chroma_size(w);
  for (int y = 0; y < h; y++)
    for (int x = 0; x < w; x++) {
      const uint8_t* p = rgb.pixel(x, y);
      out.plane(0)[static_cast<size_t>(y) * w + x] = to_byte(0.299 * p[0] + 0.587 * p[1] + 0.114 * p[2]);
    }
  for (int y = 0; y < chroma_size(h); y++)
    for (int x = 0; x < cw; x++) {
      double sum[3] = {};
      int n = 0;
      for (int yy = 2 * y; yy < std::min(2 * y + 2, h); yy++)
        for (int xx = 2 * x; xx < std::min(2 * x + 2, w); xx++, n++)
          for (int c = 0; c < 3; c++) sum[c] += rgb.pixel(xx, yy)[c];
      const double r = sum[0] / n, g = sum[1] / n, b = sum[2] / n;
      out.plane(1)[static_cast<size_t>(y) * cw + x] = to_byte(128 - 0.168736 * r - 0.331264 * g + 0.5 * b);
      out.plane(2)[static_cast<size_t>(y) * cw + x] = to_byte(128 + 0.5 * r - 0.418688 * g - 0.081312 * b);
    }
  return out;
}

Image to_rgb(const Image& i420) {
  Image out(PixelFamily::kRgb, i420.width(), i420.height());
  const int w = i420.width(), cw = chroma_size(w);
  for (int y = 0; y < i420.height(); y++)
    for (int x = 0; x < w; x++) {
      const double luma = i420.plane(0)[static_cast<size_t>(y) * w + x];
      const size_t c = static_cast<size_t>(y / 2) * cw + x / 2;
      const double cb = i420.plane(1)[c] - 128.0, cr = i420.plane(2)[c] - 128.0;
      uint8_t* p = out.pixel(x, y);
      p[0] = to_byte(luma + 1.402 * cr);
      p[1] = to_byte(luma - 0.344136 * cb - 0.714136 * cr);
      p[2] = to_byte(luma + 1.772 * cb);
    }
  return out;
}

ImageView fetched(const ImageView& image, const Rect& part, FetchBuffers& memory) {
  const GpuPixels& from = image.on_gpu;
  if (!from.image) return image;
  ImageView here = from.image->fetch();
  if (here.family == PixelFamily::kNone || part.empty()) return here;
  if (from.gain != 1) {
    // Sharpening reads neighbouring pixels.
    const Rect around = from.sharpened ? intersect({part.x0 - 2, part.y0 - 2, part.x1 + 2, part.y1 + 2},
                                                   {0, 0, image.width, image.height})
                                       : part;
    here = divide_by_gain(here, around, from.gain, memory.divided);
  }
  return from.sharpened ? sharpen(here, part, memory.sharpened) : here;
}

namespace {

constexpr double kOne = 1 << 16;
constexpr int32_t kHalf = 1 << 15;
constexpr int kSixteenths = 16;  // chroma is interpolated in sixteenths of an input level

uint8_t to_level(int32_t value) { return static_cast<uint8_t>(std::clamp((value + kHalf) >> 16, 0, 255)); }

int32_t rounded(double value) { return static_cast<int32_t>(std::lround(value)); }

}  // namespace

YcbcrConversion::YcbcrConversion(const YcbcrFormat& from) : from_(from) {
  constexpr YcbcrFormat kOwn;
  const double zero = from.full_range ? 0 : 16, luma = 255. / (from.full_range ? 255 : 219);
  for (int y = 0; y < 256; y++) luma_[y] = rounded((y - zero) * luma * kOne);
  // R - Y, G - Y and B - Y for a Cb or Cr of 1, and their luma with our weights.
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

void YcbcrConversion::sited_row(const ImageView& in, int plane, int y, int32_t* out) const {
  const int width = chroma_size(in.width), height = chroma_size(in.height);
  const uint8_t* const upper = in.plane[plane] + y * in.stride[plane];
  const uint8_t* const lower = in.plane[plane] + std::min(y + 1, height - 1) * in.stride[plane];
  // A sample half a pixel before the middle is a quarter of the sample distance away, so the next sample has weight
  // 1/4.
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

namespace {

using Colour = std::array<uint8_t, 3>;

// The colours at 0, 0.1, ..., 1, with linear interpolation in between.
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
    throw Error("heat map: values and underlay must have the same size");
  for (size_t i = 0; i < values.size(); i++) {
    uint8_t* const out = &map.data()[3 * i];
    if (std::isnan(values[i])) {
      std::fill_n(out, 3, kNoValueGrey);
      continue;
    }
    const double share = std::clamp(values[i] / full, 0.0, 1.0);
    const Colour colour = heat_colour(share);
    const double through = underlay ? kUnderlayOpacity * (1 - share) * luma(&underlay->data()[3 * i]) : 0;
    for (size_t c = 0; c < 3; c++) out[c] = static_cast<uint8_t>(std::min(255.0, colour[c] + through + 0.5));
  }
  return map;
}

}  // namespace lf
