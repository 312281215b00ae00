// SPDX-License-Identifier: LGPL-2.1-or-later
#include "render/ownership.h"

#include <algorithm>

namespace lf {

OwnerMap::OwnerMap(const ViewPlan& plan, const Rect& region) : OwnerMap(OwnerRuns(plan, region)) {}

OwnerMap::OwnerMap(OwnerRuns runs) : runs_(std::move(runs)), region_(runs_.region()) {
  owner_.assign(static_cast<size_t>(region_.width()) * region_.height(), kNone);
  for (int y = region_.y0; y < region_.y1; y++)
    for (const OwnerRun& run : runs_.row(y))
      std::fill_n(&owner_[static_cast<size_t>(y - region_.y0) * region_.width() + (run.x0 - region_.x0)],
                  run.x1 - run.x0, run.face);
}

FaceWeights face_weights(const FacePlan& face, const Vec2& ray) {
  const double e0 = FacePlan::evaluate(face.edge[0], ray), e1 = FacePlan::evaluate(face.edge[1], ray),
               e2 = FacePlan::evaluate(face.edge[2], ray), sum = e0 + e1 + e2;
  return {{static_cast<float>(e0 / sum), static_cast<float>(e1 / sum), static_cast<float>(e2 / sum)}};
}

CameraCorners::CameraCorners(const ViewPlan& plan, CameraIndex camera)
    : camera_(camera), corner_(plan.faces().size(), plan.blend() ? 0 : -1) {
  for (size_t i = 0; i < corner_.size(); i++)
    for (int8_t k = 0; k < 3; k++)
      if (plan.faces()[i].camera[k] == camera) corner_[i] = k;
}

Rect CameraCorners::owned(const OwnerRuns& runs, const Rect& rect) const {
  Rect bounds;
  for (int y = rect.y0; y < rect.y1; y++)
    for (const OwnerRun& run : runs.row(y, rect.x0, rect.x1))
      if (has(run.face)) bounds = unite(bounds, {std::max(run.x0, rect.x0), y, std::min(run.x1, rect.x1), y + 1});
  return bounds;
}

std::vector<float> pixel_weights(const ViewPlan& plan, const OwnerMap& owners, CameraIndex camera, const Rect& rect) {
  const CameraCorners corners(plan, camera);
  std::vector<float> weights;
  weights.reserve(static_cast<size_t>(rect.width()) * rect.height());
  for (int y = rect.y0; y < rect.y1; y++)
    for (int x = rect.x0; x < rect.x1; x++) weights.push_back(corners.weight_at(plan, owners, x, y));
  return weights;
}

namespace {

std::vector<CameraIndex> contributing(const ViewPlan& plan, std::span<const CameraIndex> own) {
  std::vector<CameraIndex> cameras;
  for (const CameraIndex camera : own)
    if (!plan.camera_rect(camera).empty()) cameras.push_back(camera);
  return cameras;
}

Rect region(const ViewPlan& plan, const std::vector<CameraIndex>& cameras) {
  Rect all;
  for (const CameraIndex camera : cameras) all = unite(all, chroma_aligned(plan.camera_rect(camera), plan.view()));
  return all;
}

}  // namespace

RenderJob::RenderJob(const Rig& rig, const Mesh& mesh, const View& view, std::span<const CameraIndex> own,
                     const ParallelFor& parallel)
    : RenderJob(ViewPlan(rig, mesh, view, parallel), own, parallel) {}

RenderJob::RenderJob(ViewPlan plan, std::span<const CameraIndex> own, const ParallelFor& parallel)
    : plan_(std::move(plan)), cameras_(contributing(plan_, own)), runs_(plan_, region(plan_, cameras_), parallel) {}

const OwnerMap& RenderJob::owners() const {
  std::call_once(owners_made_, [this] { owners_.emplace(runs_); });
  return *owners_;
}

}  // namespace lf
