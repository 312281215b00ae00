// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <span>
#include <vector>

#include "base/parallel.h"
#include "focus/moments.h"
#include "focus/trial.h"
#include "render/render_job.h"
#include "render/sum_renderer.h"

namespace lf {

// Luma of an image, low-passed by a box of kTrialBox x kTrialBox pixels: what trials sample, so that a quarter of the
// view's resolution is enough. At full resolution: sampling an image of a quarter of the size costs 1 dB.
inline constexpr int kTrialBox = 4;  // pixels
// Value (x, y) is the mean of luma at x - 1 .. x + 2 and y - 1 .. y + 2, as far as the image goes: it belongs to
// (x + 1/2, y + 1/2).
struct BoxedLuma {
  Rect rect;  // of the image
  std::vector<uint8_t> values;
};
// `rect`: what is needed, inside the image.
void box_luma(const ImageView& image, const Rect& rect, BoxedLuma& out);

// Adds what the sources contribute to trials[i], levels of a trial of the view's map, to sums[i], of the map's size.
// `job`: of trial_view(). A camera's luma is rounded to 8 bits first, as if it had travelled. The result does not depend
// on `parallel`. Throws Error as SumRenderer.
void add_moments(const RenderJob& job, std::span<const Source> sources, std::span<const std::vector<uint8_t>> trials,
                 std::span<Moments> sums, const ParallelFor& parallel = serial_for);

}  // namespace lf
