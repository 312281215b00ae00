// SPDX-License-Identifier: LGPL-2.1-or-later
// How far SumRenderer's sums are from those in exact arithmetic.
#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <vector>

#include "lib/render/production.h"
#include "lib/render/sum_arrays.h"
#include "reference/float_renderer.h"

namespace lf::test {

inline Image checkerboard(reference::Random& random, int width, int height) {
  Image image(PixelFamily::kRgb, width, height);
  for (int y = 0; y < height; y++)
    for (int x = 0; x < width; x++)
      for (int c = 0; c < 3; c++) image.pixel(x, y)[c] = (x + y) % 2 ? 255 : 0;
  (void)random;
  return image;
}

struct Worst {
  double level = 0, chroma = 0, lost = 0;
  int64_t pixels = 0;
};

// Sums of render_float() over the view, per plane: R, G, B or Y, Cb, Cr.
struct FloatSum {
  FloatSum(const Rig& rig, const Production& production, const std::vector<Image>& images) {
    const View& view = production.plan.view();
    const bool i420 = images.front().family() == PixelFamily::kI420;
    width = view.width;
    for (int c = 0; c < 3; c++) {
      stride[c] = i420 && c > 0 ? chroma_size(width) : width;
      plane[c].resize(static_cast<size_t>(stride[c]) * (i420 && c > 0 ? chroma_size(view.height) : view.height));
    }
    lost.resize(static_cast<size_t>(width) * view.height);
    for (const CameraIndex i : production.plan.contributors()) {
      const auto f = render_float(production.plan, production.owners, i, rig.cameras[i], images[i].view());
      if (!f) continue;
      const Rect& rect = f->rect;
      size_t from = 0;
      for (int y = rect.y0; y < rect.y1; y++)
        for (int x = rect.x0; x < rect.x1; x++, from++) {
          lost[y * width + x] += f->lost[from];
          for (int c = 0; c < 3 && !i420; c++) plane[c][y * width + x] += f->colour[3 * from + c];
          if (i420) plane[0][y * width + x] += f->colour[from];
        }
      for (int c = 1; c < 3 && i420; c++)
        for (int y = 0; y < chroma_size(rect.height()); y++)
          for (int x = 0; x < chroma_size(rect.width()); x++, from++)
            plane[c][(rect.y0 / 2 + y) * stride[c] + rect.x0 / 2 + x] += f->colour[from];
    }
  }
  int width;
  int stride[3];
  std::vector<double> plane[3], lost;
};

// Beside render_float(), in sums that are not divided by what was lost.
inline void compare(const Rig& rig, const View& view, const std::vector<Image>& rgb, PixelFamily family,
                    Coordinates coordinates, Worst& worst) {
  const Mesh mesh = build_mesh(rig);
  const Production production(rig, mesh, view);
  const std::vector<Image> images = family == PixelFamily::kI420 ? i420_of(rgb) : rgb;
  const FloatSum expected(rig, production, images);
  const OwnerRuns runs(production.plan, whole(view));
  auto sources = sources_of(rig, production.plan, images);
  const SumRenderer renderer(production.plan, runs, sources, family, coordinates);
  const Rect& rect = renderer.rect();
  if (rect.empty()) return;
  Sum sum(family, rect);
  const bool any_lost = renderer.render_rows(rect.y0, rect.y1, sum.planes);
  bool expect_lost = false;
  for (int y = rect.y0; y < rect.y1; y++)
    for (int x = rect.x0; x < rect.x1; x++) {
      worst.pixels++;
      const double lost = expected.lost[y * view.width + x];
      expect_lost = expect_lost || lost > 1e-4;
      worst.lost = std::max(worst.lost, std::abs(sum.lost_weight(x, y) - lost));
    }
  EXPECT_TRUE(any_lost || !expect_lost);
  for (int c = 0; c < 3; c++) {
    const int shift = family == PixelFamily::kI420 && c > 0 ? 1 : 0;
    for (int y = rect.y0 >> shift; y < (rect.y1 + shift) >> shift; y++)
      for (int x = rect.x0 >> shift; x < (rect.x1 + shift) >> shift; x++) {
        const int16_t value =
            sum.planes.plane[c][(y - (rect.y0 >> shift)) * sum.planes.stride[c] + x - (rect.x0 >> shift)];
        const double error = std::abs(value / 128.0 - expected.plane[c][y * expected.stride[c] + x]);
        double& largest = shift ? worst.chroma : worst.level;
        largest = std::max(largest, error);
      }
  }
}

}  // namespace lf::test
