// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "base/parallel.h"
#include "focus/moments.h"
#include "render/render_job.h"
#include "render/sum_renderer.h"

namespace lf {

// What one camera sees through trials: luma, a byte for each node of `rect`, which has all nodes that it has a weight
// in. Of no meaning where it has none or sees nothing.
struct CameraTrials {
  CameraIndex camera = 0;
  Rect rect;
  std::vector<std::vector<uint8_t>> luma;  // of each trial, row-major
  bool operator==(const CameraTrials&) const = default;
};

// Of every source that has an image and any weight. `job`: of trial_view(); `trials`: levels of each. The result does
// not depend on `parallel`. Throws Error as SumRenderer.
std::vector<CameraTrials> sample_trials(const RenderJob& job, std::span<const Source> sources,
                                        std::span<const std::vector<uint8_t>> trials,
                                        const ParallelFor& parallel = serial_for);

// Adds what a camera has seen with its weights, which follow from the geometry: the very sums of add_moments(). False,
// and nothing is added, if it is not as many trials or not in the rectangle that the camera has a weight in. `job`: of
// all cameras whose trials are added, `rig_camera`: of the rig that it is of.
bool add_camera_trials(const RenderJob& job, const Camera& rig_camera, const CameraTrials& seen,
                       std::span<const std::vector<uint8_t>> trials, std::span<Moments> sums);

}  // namespace lf
