// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <algorithm>
#include <cstdint>
#include <span>
#include <vector>

#include "focus/trial_row.h"
#include "render/ownership.h"
#include "render/render_job.h"

// Where cameras look for the nodes of trials: the same to the bit for whoever samples their images and for whoever adds
// up what others have sampled.
namespace lf {

// CameraProjection in float. `plan`: of trial_view().
TrialProjection trial_projection(const ViewPlan& plan, CameraIndex camera, const Camera& rig_camera);

// One camera, with what is needed of it for every row. `job`: of trial_view().
struct TrialCamera {
  TrialCamera(const RenderJob& job, CameraIndex index, const Camera& rig_camera);
  CameraCorners corners;
  Rect rect;  // of nodes that it has a weight in
  TrialProjection projection;
};

// One camera's weights in a row of nodes.
class TrialRow {
 public:
  explicit TrialRow(const RenderJob& job);

  void begin(int row);
  // From the first node that the camera has a weight in to the last; some in between may have none. Valid until the
  // next call.
  TrialNodes find(const TrialCamera& camera);

 private:
  void weigh(const OwnerRun& run, int corner);

  const RenderJob& job_;
  int row_ = 0;
  std::vector<float> u_, v_, weight_;  // of every column
};

// Calls fn(trial, node of the map, weight, x, y in the camera's image) for what the camera sees in rows [y0, y1) of the
// map. `trials`: levels of each.
template <class Fn>
void for_trial_nodes(const RenderJob& job, const TrialCamera& camera, std::span<const std::vector<uint8_t>> trials,
                     int y0, int y1, const Fn& fn) {
  const int columns = job.plan().view().width;
  TrialRow row(job);
  std::vector<float> x(columns), y(columns);
  std::vector<uint8_t> seen(columns);
  for (int j = std::max(y0, camera.rect.y0); j < std::min(y1, camera.rect.y1); j++) {
    row.begin(j);
    const TrialNodes nodes = row.find(camera);
    const size_t offset = static_cast<size_t>(j) * columns;
    for (size_t t = 0; t < trials.size(); t++) {
      project_trial(camera.projection, nodes, &trials[t][offset], x.data(), y.data(), seen.data());
      for (int i = nodes.first; i < nodes.end; i++)
        if (seen[i] && nodes.weight[i] > 0) fn(t, offset + i, nodes.weight[i], x[i], y[i]);
    }
  }
}

}  // namespace lf
