// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <algorithm>
#include <optional>
#include <random>
#include <utility>
#include <vector>

#include "composite/accumulator.h"
#include "image/image.h"
#include "render/ownership.h"
#include "render/sum_planes.h"
#include "render/sum_renderer.h"

namespace lf::test {

inline constexpr PixelFamily kFamilies[] = {PixelFamily::kRgb, PixelFamily::kI420};

inline Accumulator empty_sum(PixelFamily family, int width, int height) {
  Accumulator sum;
  sum.reset(family, width, height);
  return sum;
}

inline Fragment blank(PixelFamily family, const Rect& rect) {
  Fragment f;
  f.family = family;
  f.rect = rect;
  f.pixels.assign(packed_size(family, rect.width(), rect.height()), 0);
  return f;
}

inline size_t area(const Rect& r) { return static_cast<size_t>(r.width()) * r.height(); }

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

inline std::vector<Fragment> halves_of(const Fragment& whole) {
  std::vector<Fragment> halves;
  const int width = whole.rect.width(), middle = (whole.rect.y0 + whole.rect.y1) / 2;
  for (const auto& [y0, y1] : {std::pair{whole.rect.y0, middle}, {middle, whole.rect.y1}}) {
    const auto first = static_cast<ptrdiff_t>(y0 - whole.rect.y0) * width;
    const auto past = static_cast<ptrdiff_t>(y1 - whole.rect.y0) * width;
    Fragment half{whole.family, {whole.rect.x0, y0, whole.rect.x1, y1}, {}, {}};
    half.pixels.assign(whole.pixels.begin() + 3 * first, whole.pixels.begin() + 3 * past);
    if (!whole.lost.empty()) half.lost.assign(whole.lost.begin() + first, whole.lost.begin() + past);
    halves.push_back(std::move(half));
  }
  return halves;
}

inline std::optional<Fragment> rounded_sum(const Accumulator& accumulator) {
  const std::optional<ConstSumPlanes> sums = accumulator.sums();
  return sums ? std::optional(rounded_fragment(*sums)) : std::nullopt;
}

// Returns the contribution of a node with one camera, in 8 bits and one rectangle, or nullopt without weight. `runs`
// hold the camera's chroma-aligned rectangle.
inline std::optional<Fragment> camera_part(const ViewPlan& plan, const FaceRuns& runs, const Source& source,
                                           Coordinates coordinates = Coordinates::kGrid) {
  const PixelFamily family = source.image.family;
  const SumRenderer renderer(plan, runs, {&source, 1}, family, coordinates);
  Rect rect = CameraCorners(plan, source.camera).owned(runs, plan.camera_rect(source.camera));
  if (rect.empty()) return std::nullopt;
  if (family == PixelFamily::kI420) rect = chroma_aligned(rect, plan.view());
  const size_t area = static_cast<size_t>(rect.width()) * rect.height();
  std::vector<int16_t> samples(3 * area);
  std::vector<uint16_t> lost(area);
  const bool any_missing =
      renderer.render_rows(rect.y0, rect.y1, packed_sums(family, rect, samples.data(), lost.data()));
  return rounded_fragment(
      packed_sums<const int16_t, const uint16_t>(family, rect, samples.data(), any_missing ? lost.data() : nullptr));
}

}  // namespace lf::test

namespace lf {

// Returns fragments of nodes for a view of `width` x `height` of the built-in scene. The side x side array fills the
// view, so a fragment has about 2 width / side x 2 height / side pixels. Uses `count` cameras (at most side * side)
// around the middle of the array, in index order.
std::vector<Fragment> weighted_fragments(PixelFamily family, int side, int width, int height, int count);

}  // namespace lf
