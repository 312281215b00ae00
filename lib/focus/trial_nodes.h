// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <algorithm>
#include <cstdint>
#include <span>
#include <vector>

#include "render/contribution.h"
#include "render/render_job.h"

// Where cameras look for the nodes of trials: the same to the bit for whoever samples their images and for whoever adds
// up what others have sampled.
namespace lf {

// One camera, with what is needed of it for every row. `job`: of trial_view().
struct TrialCamera {
  TrialCamera(const RenderJob& job, CameraIndex index, const Camera& rig_camera)
      : corners(job.plan(), index),
        rect(corners.owned(job.runs(), job.plan().camera_rect(index))),
        projection(job.plan(), index, rig_camera),
        width(static_cast<float>(rig_camera.width)),
        height(static_cast<float>(rig_camera.height)) {}
  CameraCorners corners;
  Rect rect;  // of nodes that it has a weight in
  CameraProjection projection;
  float width, height;
};

// The nodes of a row in which a camera has a weight. Camera coordinates are base + inverse distance x slope, up to a
// positive factor.
struct TrialRow {
  std::vector<int> column;
  std::vector<float> weight, base[3], slope[3], x, y;
  std::vector<uint8_t> seen;
  size_t count = 0;

  void find(const RenderJob& job, const TrialCamera& camera, int row);
  // CameraProjection::project() in float: positions in the image, and which are seen there.
  void project(const FocalMap& map, const uint8_t* levels, const TrialCamera& camera, double eye_distance);
};

// Calls fn(trial, node of the map, weight, x, y in the camera's image) for what the camera sees in rows [y0, y1) of the
// map. `trials`: levels of each.
template <class Fn>
void for_trial_nodes(const RenderJob& job, const TrialCamera& camera, std::span<const std::vector<uint8_t>> trials,
                     int y0, int y1, const Fn& fn) {
  thread_local TrialRow nodes;
  const FocalMap& map = *job.plan().view().focus.map;
  for (int row = std::max(y0, camera.rect.y0); row < std::min(y1, camera.rect.y1); row++) {
    nodes.find(job, camera, row);
    const size_t row_offset = static_cast<size_t>(row) * static_cast<size_t>(map.columns);
    for (size_t t = 0; t < trials.size(); t++) {
      nodes.project(map, trials[t].data() + row_offset, camera, job.plan().eye_distance());
      for (size_t i = 0; i < nodes.count; i++)
        if (nodes.seen[i])
          fn(t, row_offset + static_cast<size_t>(nodes.column[i]), nodes.weight[i], nodes.x[i], nodes.y[i]);
    }
  }
}

}  // namespace lf
