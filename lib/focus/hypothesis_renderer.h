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

// Renders depth hypotheses: samples the cameras' images through each hypothesis, and adds the samples to
// photo-consistency sums. Another process may take the samples, and the results must still be the same. Therefore both
// use the positions that these functions compute.

// Returns the projection into a camera, with the smallest low-pass box. `plan` is the plan of hypothesis_view().
HypothesisProjection hypothesis_projection(const ViewPlan& plan, CameraIndex camera, const Camera& rig_camera);

// Returns the side of the box that low-passes luma, in pixels: the power of two that is nearest to the distance between
// the nodes in the camera's image. A smaller box would cause aliasing. The distance is measured in the middle of the
// camera's part of the view and in the middle of the map's range. If the camera has no part, the middle of the whole
// view is used. `plan` is the plan of hypothesis_view().
int hypothesis_box(const ViewPlan& plan, CameraIndex camera, const Camera& rig_camera);
// Returns the region of a camera's image that the hypotheses sample, like needed_pixels(). `plan` is the plan of
// hypothesis_view().
Rect hypothesis_pixels(const ViewPlan& plan, CameraIndex camera, const Camera& rig_camera,
                       std::span<const std::vector<uint8_t>> hypotheses);

// A camera, and the nodes of the map where the camera has a weight. In each row these are the nodes from the first to
// the last with a weight, and nodes in between may have weight 0. Arrays contain the nodes row by row, and
// kHypothesisPadding unused values at the end. `job` is the RenderJob of hypothesis_view().
struct HypothesisCamera {
  HypothesisCamera(const RenderJob& job, CameraIndex index, const Camera& rig_camera);

  Rect rect;  // bounds of the nodes with a weight
  HypothesisProjection projection;
  std::vector<HypothesisRow> rows;
  UninitializedVector<float> u, v, weight;  // line of sight and weight of each node

  HypothesisRays rays() const { return {u.data(), v.data(), static_cast<int>(u.size() - kHypothesisPadding)}; }
  // Returns the levels of several hypotheses at this camera's nodes, for sample_hypotheses(). `hypotheses` contains the
  // levels of whole maps with `columns` columns.
  ByteBuffer levels_of(std::span<const std::vector<uint8_t>> hypotheses, int columns) const;

 private:
  void add(const RenderJob& job, CameraIndex camera, const CameraCorners& corners, const Rect& region, int y);
};

// Samples the images in `sources` through each hypothesis, and adds the contributions to its photo-consistency sums.
// The levels of hypothesis i are in hypotheses[i], and its sums in sums[i]. Each has the size of the view's map. `job`
// is the RenderJob of hypothesis_view(). Luma is rounded to 8 bits first, as in transmission. The result does not
// depend on `parallel`. Throws Error like SumRenderer.
//
// If sources have a visibility mask, the first hypothesis must be the surface of the view, and the masks reduce the
// weights of its contributions.
//
// `gpu` is used where possible (for its errors see GlesRenderer::draw_consistency()), otherwise the CPU. Returns
// whether the GPU was used.
GpuStatus add_consistency(const RenderJob& job, std::span<const Source> sources,
                          std::span<const std::vector<uint8_t>> hypotheses, std::span<PhotoConsistency> sums,
                          const ParallelFor& parallel = serial_for, gl::GlesRenderer* gpu = nullptr);

}  // namespace lf
