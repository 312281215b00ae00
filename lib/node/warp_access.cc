// SPDX-License-Identifier: LGPL-2.1-or-later
#include "node/camera_access.h"
#include "render/camera_projection.h"

namespace lf {
namespace {

class WarpTask : public SumTask {
 public:
  using SumTask::SumTask;
  // The command does not say where the view is from.
  bool shows_detail(CameraIndex camera) const override {
    return !is_coarse(job_.plan().view().lens, rig_.cameras[camera].lens);
  }
};

class WarpAccess : public CameraAccess {
 public:
  wire::AnyRequest command(const Rig& rig, const Mesh& mesh, const ViewRequest& request) const override {
    View view = request.view;
    view.focus.map = nullptr;  // a matrix for each camera is one plane's: the viewer's
    view.blending = blending(view.blending);
    return wire::WarpCommand{request, view_warp(rig, ViewPlan(rig, mesh, view))};
  }
  Blending blending(const Blending&) const override { return {}; }  // triangles are the mesh's
  std::unique_ptr<AnswerTask> task(const Rig& rig, const wire::AnyRequest& command, std::span<const CameraIndex> own,
                                   const ParallelFor& parallel) const override {
    const auto& warp = std::get<wire::WarpCommand>(command);
    return std::make_unique<WarpTask>(rig, ViewPlan(warp.warp, rig.cameras.size(), parallel), warp.quality, own,
                                      parallel);
  }
};

}  // namespace

const CameraAccess& warp_access() {
  static const WarpAccess access;
  return access;
}

}  // namespace lf
