// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <atomic>
#include <memory>
#include <span>
#include <vector>

#include "base/byte_buffer.h"
#include "render/fragment_planes.h"
#include "render/sum_renderer.h"

namespace lf {

// One camera's fragment of a view.
struct CameraFragment {
  CameraIndex camera = Fragment::kSum;
  FragmentPlanes planes;
  bool plain = false;  // no contribution, but pixels of the camera's image as they are: planes.rect is in that
};

// The fragments of any number of cameras, by the same code as SumRenderer and as good: weights are found once for all
// of them. Keeps its memory from view to view.
class FragmentSet {
 public:
  FragmentSet();
  ~FragmentSet();

  // Takes the place of what was there. Arguments and errors as for SumRenderer; they must outlive the rendering.
  void begin(const ViewPlan& plan, const OwnerRuns& runs, std::span<const Source> sources, PixelFamily family,
             Coordinates coordinates = Coordinates::kGrid);
  // Bounds the rows of all; y0 even.
  const Rect& rect() const { return rect_; }
  // Renders rows [y0, y1) of the view; y0 even. Every row of rect() once, in any order; call from several threads.
  void render_rows(int y0, int y1);
  // When all rows are there: of the cameras with weight in the view, in the order of the sources, in tight rectangles
  // (chroma-aligned in kI420). Memory of this object, until the next begin().
  const std::vector<CameraFragment>& fragments();

 private:
  struct State;
  std::unique_ptr<State> state_;
  Rect rect_;
  ByteBuffer memory_;
  std::vector<std::atomic<bool>> any_lost_;
  std::vector<CameraFragment> fragments_;
};

}  // namespace lf
