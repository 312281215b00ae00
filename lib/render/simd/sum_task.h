// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <span>
#include <vector>

#include "render/camera_projection.h"
#include "render/simd/band_data.h"
#include "render/sum_renderer.h"

namespace lf::simd {

// A task with what its slots point at. Stays where it was made.
struct PreparedTask {
  // See SumRenderer.
  PreparedTask(const ViewPlan& plan, const OwnerRuns& runs, std::span<const Source> sources, PixelFamily family,
               Coordinates coordinates);
  PreparedTask(const PreparedTask&) = delete;
  PreparedTask& operator=(const PreparedTask&) = delete;

  SumTask task;
  Rect rect;  // bounds the rectangles of all slots

 private:
  std::vector<CameraProjection> projections;
};

// Gives a slot of a task its image in this process's memory, in place of the same image on a card.
void place_image(const SumTask& task, Slot& slot, const ImageView& image);

// Pixels of the rectangle times cameras that may have a weight there.
size_t samples_of(const SumTask& task, const Rect& rect);

// The calling thread's memory, with room for a rectangle and a number of slots, and nothing known of them.
Scratch& scratch_for(const Rect& rect, size_t slots);

}  // namespace lf::simd
