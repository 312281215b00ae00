// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <algorithm>
#include <cmath>
#include <span>
#include <vector>

#include "jpeg/fragment_decoder.h"
#include "jpeg/fragment_encoder.h"

// What the tests of both directions share.
namespace lf::jpeg {

inline std::vector<FragmentPlanes> planes_of_all(const std::vector<Fragment>& fragments) {
  std::vector<FragmentPlanes> planes;
  for (const Fragment& f : fragments) planes.push_back(planes_of(f));
  return planes;
}

// The same fragment without anything in it, for a decoder to fill.
inline FragmentPlanes empty_like(const FragmentPlanes& fragment) {
  return {.family = fragment.family, .rect = fragment.rect};
}

// Differences of one plane's values, in levels.
struct Errors8 {
  double squares = 0, count = 0;
  int worst = 0;

  void add(int a, int b) {
    squares += (a - b) * (a - b);
    count++;
    worst = std::max(worst, std::abs(a - b));
  }
  double psnr() const { return squares == 0 ? 99 : 10 * std::log10(255. * 255. * count / squares); }
};

// Of the pixels of two fragments of one rectangle, luma (or RGB) and chroma.
inline void compare_pixels(const FragmentPlanes& a, const FragmentPlanes& b, Errors8& luma, Errors8& chroma) {
  const int w = a.rect.width(), h = a.rect.height();
  const bool rgb = a.family == PixelFamily::kRgb;
  for (int y = 0; y < h; y++)
    for (int x = 0; x < (rgb ? 3 * w : w); x++)
      luma.add(a.plane[0][y * a.stride[0] + x], b.plane[0][y * b.stride[0] + x]);
  if (rgb) return;
  for (int c = 1; c < 3; c++)
    for (int y = 0; y < chroma_size(h); y++)
      for (int x = 0; x < chroma_size(w); x++)
        chroma.add(static_cast<int8_t>(a.plane[c][y * a.stride[c] + x]),
                   static_cast<int8_t>(b.plane[c][y * b.stride[c] + x]));
}

inline void compare_lost(const FragmentPlanes& a, const FragmentPlanes& b, Errors8& errors) {
  for (int y = 0; y < a.rect.height(); y++)
    for (int x = 0; x < a.rect.width(); x++) errors.add(a.lost[y * a.lost_stride + x], b.lost[y * b.lost_stride + x]);
}

// A fragment of a smooth pattern under a pyramid of weights, and lost weight right of a slanting edge if `lost`.
inline Fragment patterned(PixelFamily family, const Rect& rect, bool lost = false, int seed = 1) {
  const int w = rect.width(), h = rect.height();
  Fragment f{family, rect, {}, {}};
  const auto weight = [&](double x, double y) {
    return std::max(0., 1 - std::max(std::abs(2 * x / w - 1), std::abs(2 * y / h - 1)));
  };
  const auto value = [&](double x, double y, int c) {
    return std::sin(x * (.11 + .03 * c) + seed) * std::cos(y * .13 + c);
  };
  if (family == PixelFamily::kRgb) {
    for (int y = 0; y < h; y++)
      for (int x = 0; x < w; x++)
        for (int c = 0; c < 3; c++)
          f.pixels.push_back(static_cast<uint8_t>(weight(x, y) * (128 + 60 * value(x, y, 0) + 20 * value(x, y, c))));
  } else {
    for (int y = 0; y < h; y++)
      for (int x = 0; x < w; x++) f.pixels.push_back(static_cast<uint8_t>(weight(x, y) * (128 + 100 * value(x, y, 0))));
    for (int c = 1; c < 3; c++)
      for (int y = 0; y < chroma_size(h); y++)
        for (int x = 0; x < chroma_size(w); x++)
          f.pixels.push_back(static_cast<uint8_t>(static_cast<int>(weight(2 * x, 2 * y) * 90 * value(x, y, c))));
  }
  if (lost)
    for (int y = 0; y < h; y++)
      for (int x = 0; x < w; x++)
        f.lost.push_back(x > w / 2 + y / 4 ? static_cast<uint8_t>(255 * weight(x, y)) : uint8_t{0});
  return f;
}

}  // namespace lf::jpeg
