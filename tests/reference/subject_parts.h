// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <vector>

#include "reference/numerics.h"
#include "render/ownership.h"
#include "render/sum_renderer.h"

// What the subjects are made of.
namespace lf::reference {

struct Plans {
  Plans(const Rig& rig, const Mesh& mesh, const View& view)
      : plan(rig, mesh, view), owners(plan, {0, 0, view.width, view.height}) {}
  ViewPlan plan;
  OwnerMap owners;
};

// Adds the values of `rect`, row after row, to a plane of the whole view.
template <class T>
void place(const T* values, const Rect& rect, int width, double scale, std::vector<double>& plane) {
  for (int y = rect.y0; y < rect.y1; y++)
    for (int x = rect.x0; x < rect.x1; x++) plane[static_cast<size_t>(y) * width + x] += *values++ * scale;
}

// Red as luma: then the luma of I420 images has a known rule, rounded nowhere.
Image as_i420(const Image& rgb);

// SumRenderer's 16-bit sums of all cameras, resolved by the compositor; of a card, where there is one given.
Subject of_sums(std::string name, PixelFamily family, Coordinates coordinates, gl::SumDrawer* card = nullptr);

}  // namespace lf::reference
