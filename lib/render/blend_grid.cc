// SPDX-License-Identifier: LGPL-2.1-or-later
#include "render/blend_grid.h"

#include <cmath>

namespace lf {

BlendGrid::BlendGrid(int width, int height, size_t num_cameras)
    : width_(width), height_(height), columns_(nodes(width)), rows_(nodes(height)), rects_(num_cameras) {
  first_.reserve(static_cast<size_t>(columns_) * rows_ + 1);
}

void BlendGrid::add_node(std::span<const Share> shares) {
  const auto node = static_cast<int>(first_.size() - 1);
  const int x = node % columns_ * kStep, y = node / columns_ * kStep;
  double total = 0;
  for (const Share& share : shares) total += share.weight;
  double sum = 0;
  int32_t before = 0;
  for (const Share& share : shares) {
    sum += share.weight;
    const auto with = static_cast<int32_t>(std::lround(sum / total * kOne));
    if (with == before) continue;
    entries_.push_back({share.camera, before, with});
    before = with;
    const Rect reach{x - kStep + 1, y - kStep + 1, x + kStep, y + kStep};
    rects_[share.camera] = unite(rects_[share.camera], intersect(reach, {0, 0, width_, height_}));
  }
  first_.push_back(entries_.size());
}

// Of a camera without a weight at the node: what those before it sum to.
BlendGrid::Entry BlendGrid::lookup(size_t node, CameraIndex camera) const {
  const auto begin = entries_.begin() + static_cast<ptrdiff_t>(first_[node]),
             end = entries_.begin() + static_cast<ptrdiff_t>(first_[node + 1]);
  const auto found = std::ranges::lower_bound(begin, end, camera, {}, &Entry::camera);
  if (found != end && found->camera == camera) return *found;
  const int32_t sum = found == begin ? 0 : (found - 1)->with;
  return {camera, sum, sum};
}

bool BlendGrid::find(CameraIndex camera, int i, int j, Cell& cell) const {
  const size_t node = static_cast<size_t>(j) * columns_ + i;
  const size_t at[4] = {node, node + 1, node + columns_, node + columns_ + 1};
  bool any = false;
  for (size_t k = 0; k < 4; k++) {
    const Entry entry = lookup(at[k], camera);
    cell.before[k] = entry.before;
    cell.with[k] = entry.with;
    any = any || entry.with != entry.before;
  }
  return any;
}

}  // namespace lf
