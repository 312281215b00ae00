// SPDX-License-Identifier: LGPL-2.1-or-later
#include "render/render_job.h"

namespace lf {
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

RenderJob::RenderJob(const Rig& rig, const Mesh& mesh, const View& view, std::span<const CameraIndex> own)
    : RenderJob(ViewPlan(rig, mesh, view), own) {}

RenderJob::RenderJob(ViewPlan plan, std::span<const CameraIndex> own)
    : plan_(std::move(plan)), cameras_(contributing(plan_, own)), runs_(plan_, region(plan_, cameras_)) {}

const OwnerMap& RenderJob::owners() const {
  std::call_once(owners_made_, [this] { owners_.emplace(runs_); });
  return *owners_;
}

const Mesh& MeshCache::get(const Rig& rig, const CameraSet& out_of_service) {
  if (!mesh_ || out_of_service != out_of_service_) {
    mesh_ = build_mesh(rig, out_of_service);
    out_of_service_ = out_of_service;
  }
  return *mesh_;
}

}  // namespace lf
