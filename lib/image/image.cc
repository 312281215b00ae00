// SPDX-License-Identifier: LGPL-2.1-or-later
#include "image/image.h"

#include <algorithm>
#include <cmath>

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

}  // namespace lf
