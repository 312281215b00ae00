// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "base/memory.h"
#include "base/worker_pool.h"
#include "focus/moments.h"
#include "focus/trial_levels.h"
#include "focus/trial_projection.h"
#include "focus/trial_samples.h"
#include "render/ownership.h"
#include "render/sum_renderer.h"

namespace lf {

// These find where cameras look for the nodes of trials: the same places to the bit for whoever samples their images
// and for whoever adds up what others have sampled.

// The projection of a camera in float, with the least box. `plan`: of trial_view().
TrialProjection trial_projection(const ViewPlan& plan, CameraIndex camera, const Camera& rig_camera);

// The size of box that belongs to how far apart nodes are in a camera's image, in the middle of what the camera
// contributes to (of the view, if that is nothing) and of the map's range: the nearest power of two. With smaller ones
// most pixels would not count, and it would be chance how bright a camera's part of a trial is. `plan`: of
// trial_view().
int trial_box(const ViewPlan& plan, CameraIndex camera, const Camera& rig_camera);
// The pixels of a camera's image that trials look at, as needed_pixels(). `plan`: of trial_view().
Rect trial_pixels(const ViewPlan& plan, CameraIndex camera, const Camera& rig_camera,
                  std::span<const std::vector<uint8_t>> trials);

// One camera, and the nodes of a trial that it has a weight in: in each row from the first of them to the last; some in
// between may have none. What is known of them lies one after the other, row by row, and kTrialSpare values of no
// meaning behind them. `job`: of trial_view().
struct TrialCamera {
  TrialCamera(const RenderJob& job, CameraIndex index, const Camera& rig_camera);

  Rect rect;  // bounds the nodes in which the camera has a weight
  TrialProjection projection;
  std::vector<TrialRow> rows;
  UninitializedVector<float> u, v, weight;  // lines of sight; the camera's weight

  TrialRays rays() const { return {u.data(), v.data(), static_cast<int>(u.size() - kTrialSpare)}; }
  // The levels of trials at this camera's nodes, as see_trials() takes them. `trials`: levels of each, of a map of
  // `columns`.
  ByteBuffer levels_of(std::span<const std::vector<uint8_t>> trials, int columns) const;

 private:
  void add(const RenderJob& job, CameraIndex camera, const CameraCorners& corners, const Rect& region, int y);
};

// Adds what the sources contribute to trials[i], levels of a trial of the view's map, to sums[i], of the map's size.
// `job`: of trial_view(). A camera's luma is rounded to 8 bits first, as if it had travelled. The result does not
// depend on `parallel`. Throws Error as SumRenderer.
// `card`: draws them where it can (SumDrawer::draw_moments() has the errors that come with it); else the CPU does.
Drawing add_moments(const RenderJob& job, std::span<const Source> sources, std::span<const std::vector<uint8_t>> trials,
                    std::span<Moments> sums, const ParallelFor& parallel = serial_for, gl::SumDrawer* card = nullptr);

}  // namespace lf
