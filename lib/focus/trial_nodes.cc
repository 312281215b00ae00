// SPDX-License-Identifier: LGPL-2.1-or-later
#include "focus/trial_nodes.h"

#include "render/camera_projection.h"

namespace lf {

TrialProjection trial_projection(const ViewPlan& plan, CameraIndex camera, const Camera& rig_camera) {
  TrialProjection projection;
  const CameraProjection exact(plan, camera, rig_camera);
  for (int k = 0; k < 3; k++)
    for (int column = 0; column < 3; column++) {
      projection.base[3 * k + column] = static_cast<float>(exact.camera_from_ray()[column][k]);
      projection.slope[3 * k + column] = static_cast<float>(exact.per_inverse()[column][k]);
    }
  const Lens& lens = rig_camera.lens;
  projection.fx = static_cast<float>(lens.fx());
  projection.fy = static_cast<float>(lens.fy());
  projection.cx = static_cast<float>(lens.cx());
  projection.cy = static_cast<float>(lens.cy());
  projection.k1 = static_cast<float>(lens.k1());
  projection.k2 = static_cast<float>(lens.k2());
  projection.p1 = static_cast<float>(lens.p1());
  projection.p2 = static_cast<float>(lens.p2());
  projection.distorted = lens.has_distortion();
  projection.max_r2 = static_cast<float>(std::min(lens.max_radius() * lens.max_radius(), 1e30));
  projection.width = static_cast<float>(rig_camera.width);
  projection.height = static_cast<float>(rig_camera.height);
  const FocalMap& map = *plan.view().focus.map;
  projection.farthest = static_cast<float>(map.farthest);
  projection.per_level = static_cast<float>((map.nearest - map.farthest) / FocalMap::kLevels);
  projection.eye_distance = static_cast<float>(plan.eye_distance());
  return projection;
}

TrialCamera::TrialCamera(const RenderJob& job, CameraIndex index, const Camera& rig_camera)
    : corners(job.plan(), index),
      rect(corners.owned(job.runs(), job.plan().camera_rect(index))),
      projection(trial_projection(job.plan(), index, rig_camera)) {}

TrialRow::TrialRow(const RenderJob& job) : job_(job), u_(job.plan().view().width), v_(u_.size()), weight_(u_.size()) {}

void TrialRow::begin(int row) {
  row_ = row;
  for (size_t x = 0; x < u_.size(); x++) {
    const Vec2 ray = job_.plan().rays().at(static_cast<int>(x), row);
    u_[x] = static_cast<float>(ray.x);
    v_[x] = static_cast<float>(ray.y);
  }
}

TrialNodes TrialRow::find(const TrialCamera& camera) {
  int first = 0, end = -1;
  for (const OwnerRun& run : job_.runs().row(row_, camera.rect.x0, camera.rect.x1)) {
    const int corner = camera.corners.of_face(run.face);
    if (corner < 0) continue;
    if (end < 0)
      first = run.x0;
    else
      std::fill(&weight_[end], &weight_[run.x0], 0.f);
    weigh(run, corner);
    end = run.x1;
  }
  return {u_.data(), v_.data(), weight_.data(), first, std::max(end, first), static_cast<int>(u_.size())};
}

void TrialRow::weigh(const OwnerRun& run, int corner) {
  const ViewPlan& plan = job_.plan();
  const FacePlan& face = plan.faces()[run.face];
  if (!plan.rays().separable()) {
    for (int x = run.x0; x < run.x1; x++) weight_[x] = face_weights(face, plan.rays().at(x, row_)).w[corner];
    return;
  }
  const Vec2 ray = plan.rays().at(run.x0, row_);
  const double spacing = plan.rays().at(run.x0 + 1, row_).x - ray.x;
  double edge[3], step[3];
  for (int k = 0; k < 3; k++) {
    edge[k] = FacePlan::evaluate(face.edge[k], ray);
    step[k] = face.edge[k].x * spacing;
  }
  weigh_run(edge, step, corner, run.x1 - run.x0, &weight_[run.x0]);
}

}  // namespace lf
