// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "base/memory.h"
#include "base/worker_pool.h"
#include "focus/hypothesis_levels.h"
#include "focus/hypothesis_projection.h"
#include "focus/hypothesis_samples.h"
#include "focus/photo_consistency.h"
#include "render/ownership.h"
#include "render/sum_renderer.h"

namespace lf {

// Positions of hypothesis nodes in the cameras. They are bit-identical for the code that samples images and for the
// code that adds up samples from elsewhere.

// Returns the projection of a camera in float, with the smallest box. `plan`: of hypothesis_view().
HypothesisProjection hypothesis_projection(const ViewPlan& plan, CameraIndex camera, const Camera& rig_camera);

// Returns the side of the luma box: the power of two nearest to the distance of the nodes in the camera's image. It is
// measured in the middle of the camera's part of the view (or of the view, if that is empty) and of the map's range.
int hypothesis_box(const ViewPlan& plan, CameraIndex camera, const Camera& rig_camera);
// Returns the pixels of a camera's image that hypotheses sample, like needed_pixels(). `plan`: of hypothesis_view().
Rect hypothesis_pixels(const ViewPlan& plan, CameraIndex camera, const Camera& rig_camera,
                       std::span<const std::vector<uint8_t>> hypotheses);

// A camera, and the nodes of a hypothesis at which it has a weight: in each row from the first to the last such node.
// Nodes in between may have weight 0. Arrays hold the nodes row by row, with kHypothesisPadding unused values at the
// end. `job`: of hypothesis_view().
struct HypothesisCamera {
  HypothesisCamera(const RenderJob& job, CameraIndex index, const Camera& rig_camera);

  Rect rect;  // bounds of the nodes with a weight
  HypothesisProjection projection;
  std::vector<HypothesisRow> rows;
  UninitializedVector<float> u, v, weight;  // lines of sight; the camera's weight

  HypothesisRays rays() const { return {u.data(), v.data(), static_cast<int>(u.size() - kHypothesisPadding)}; }
  // Returns the levels of hypotheses at this camera's nodes, for sample_hypotheses(). `hypotheses`: levels of each
  // hypothesis, of a map with `columns` columns.
  ByteBuffer levels_of(std::span<const std::vector<uint8_t>> hypotheses, int columns) const;

 private:
  void add(const RenderJob& job, CameraIndex camera, const CameraCorners& corners, const Rect& region, int y);
};

// Adds the contributions of the sources to hypotheses[i] to sums[i]. hypotheses[i]: levels of a hypothesis of the
// view's map; sums[i] has the size of the map. `job`: of hypothesis_view(). Luma is first rounded to 8 bits, as in
// transmission. The result does not depend on `parallel`. Throws Error like SumRenderer. `gpu`: used where possible
// (for its errors see GlesRenderer::draw_consistency()), otherwise the CPU.
GpuStatus add_consistency(const RenderJob& job, std::span<const Source> sources,
                          std::span<const std::vector<uint8_t>> hypotheses, std::span<PhotoConsistency> sums,
                          const ParallelFor& parallel = serial_for, gl::GlesRenderer* gpu = nullptr);

}  // namespace lf
