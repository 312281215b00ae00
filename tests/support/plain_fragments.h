// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <algorithm>
#include <random>

#include "image/image.h"
#include "render/sum_planes.h"

// Fragments made up for tests of what adds them.
namespace lf::test {

inline constexpr PixelFamily kFamilies[] = {PixelFamily::kRgb, PixelFamily::kI420};

inline Fragment blank(PixelFamily family, const Rect& rect) {
  Fragment f;
  f.family = family;
  f.rect = rect;
  f.pixels.assign(packed_size(family, rect.width(), rect.height()), 0);
  return f;
}

inline size_t area(const Rect& r) { return static_cast<size_t>(r.width()) * r.height(); }

// A whole-picture fragment of one colour: RGB (or Y, Cb, Cr, the latter two signed).
inline Fragment plain(PixelFamily family, const Rect& rect, int a, int b, int c) {
  Fragment f = blank(family, rect);
  if (family == PixelFamily::kRgb) {
    for (size_t i = 0; i < area(rect); i++) {
      f.pixels[3 * i] = static_cast<uint8_t>(a);
      f.pixels[3 * i + 1] = static_cast<uint8_t>(b);
      f.pixels[3 * i + 2] = static_cast<uint8_t>(c);
    }
    return f;
  }
  const size_t chroma = static_cast<size_t>(chroma_size(rect.width())) * chroma_size(rect.height());
  std::fill_n(f.pixels.begin(), area(rect), static_cast<uint8_t>(a));
  std::fill_n(f.pixels.begin() + area(rect), chroma, static_cast<uint8_t>(b));
  std::fill_n(f.pixels.begin() + area(rect) + chroma, chroma, static_cast<uint8_t>(c));
  return f;
}

inline Fragment random_fragment(PixelFamily family, int width, int height, std::mt19937& random, int max_value,
                                bool lost) {
  const auto below = [&](int n) { return static_cast<int>(random() % n); };
  const int align = family == PixelFamily::kI420 ? ~1 : ~0;
  Rect r;
  r.x0 = below(width) & align;
  r.y0 = below(height) & align;
  r.x1 = r.x0 + 1 + below(width - r.x0);
  r.y1 = r.y0 + 1 + below(height - r.y0);
  Fragment f = blank(family, r);
  for (size_t i = 0; i < f.pixels.size(); i++) {
    const bool chroma = family == PixelFamily::kI420 && i >= area(r);
    f.pixels[i] = static_cast<uint8_t>(chroma ? below(max_value + 1) - max_value / 2 : below(max_value + 1));
  }
  if (lost) {
    f.lost.resize(area(r));
    for (uint8_t& v : f.lost) v = below(3) == 0 ? static_cast<uint8_t>(below(max_value + 1)) : 0;
  }
  return f;
}

}  // namespace lf::test
