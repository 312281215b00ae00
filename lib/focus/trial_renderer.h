// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <span>
#include <vector>

#include "base/parallel.h"
#include "focus/moments.h"
#include "focus/trial_levels.h"
#include "render/render_job.h"
#include "render/sum_renderer.h"

namespace lf {

// Adds what the sources contribute to trials[i], levels of a trial of the view's map, to sums[i], of the map's size.
// `job`: of trial_view(). A camera's luma is rounded to 8 bits first, as if it had travelled. The result does not
// depend on `parallel`. Throws Error as SumRenderer.
void add_moments(const RenderJob& job, std::span<const Source> sources, std::span<const std::vector<uint8_t>> trials,
                 std::span<Moments> sums, const ParallelFor& parallel = serial_for);

}  // namespace lf
