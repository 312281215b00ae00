// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "base/rect.h"
#include "rig/rig.h"

namespace lf {

// Weights of any number of cameras over a view: nodes every `step` pixels that carry the weights of several cameras,
// bilinear in between. Node (i, j) stands at pixel (i step, j step); the last ones are at or beyond the view's border.
//
// All in integers: a weight is a number of units of 1 / kOne, and those of all cameras in a pixel sum to kOne, to the
// bit, though each camera computes its own alone. What is rounded, at nodes and between them, are the running sums over
// the cameras in the order of their indices; a camera's weight is what its own share adds to that. Immutable once made;
// share between threads.
class BlendGrid {
 public:
  static constexpr int kOne = 32768;
  static constexpr int kStep = 16, kStepBits = 4;  // pixels; a multiple of a SIMD block of the renderer
  static constexpr size_t kMaxShares = 64;         // cameras of a node

  struct Share {
    CameraIndex camera;
    double weight;  // not negative, finite; any scale
  };

  BlendGrid(int width, int height, size_t num_cameras);
  static int nodes(int pixels) { return (pixels + kStep - 1) / kStep + 1; }
  int columns() const { return columns_; }
  int rows() const { return rows_; }

  // The next node, row after row. `shares`: ascending by camera, at most kMaxShares, at least one with a weight.
  void add_node(std::span<const Share> shares);

  // One camera in the cell of pixels between four nodes: running sums without and with it at nodes (i, j), (i + 1, j),
  // (i, j + 1), (i + 1, j + 1).
  struct Cell {
    std::array<int32_t, 4> before, with;

    // In pixel (x, y) of the cell, 0..kStep - 1.
    int weight(int x, int y) const { return level(with, x, y) - level(before, x, y); }

   private:
    static int level(const std::array<int32_t, 4>& at, int x, int y) {
      const int32_t left = at[0] * (kStep - y) + at[2] * y, right = at[1] * (kStep - y) + at[3] * y;
      return (left * kStep + (right - left) * x + (1 << (2 * kStepBits - 1))) >> (2 * kStepBits);
    }
  };
  // False where the camera has no weight at any of the nodes. i < columns() - 1, j < rows() - 1.
  bool find(CameraIndex camera, int i, int j, Cell& cell) const;
  // In units of 1 / kOne. (x, y) inside the view.
  int weight(CameraIndex camera, int x, int y) const {
    Cell cell;
    return find(camera, x / kStep, y / kStep, cell) ? cell.weight(x % kStep, y % kStep) : 0;
  }
  // Bounds the pixels in which the camera may have a weight; empty if there are none.
  Rect camera_rect(CameraIndex camera) const { return rects_[camera]; }

 private:
  struct Entry {
    CameraIndex camera;
    int32_t before, with;
  };
  Entry lookup(size_t node, CameraIndex camera) const;

  int width_, height_, columns_, rows_;
  std::vector<size_t> first_{0};  // per node, and the end
  std::vector<Entry> entries_;
  std::vector<Rect> rects_;
};

}  // namespace lf
