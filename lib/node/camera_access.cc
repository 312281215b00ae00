// SPDX-License-Identifier: LGPL-2.1-or-later
#include "node/camera_access.h"

#include "render/camera_projection.h"
#include "render/view_plan.h"

namespace lf {

const CameraAccess* CameraAccess::of(Access access) {
  static const CameraAccess warp(Access::kWarp), pixels(Access::kPixels);
  return access == Access::kSelf ? nullptr : access == Access::kWarp ? &warp : &pixels;
}

Blending CameraAccess::blending(const Blending& asked) const {
  return access_ == Access::kWarp ? Blending{.extrapolates = false} : asked;
}

wire::AnyRequest CameraAccess::command(const Rig& rig, const Mesh& mesh, const ViewRequest& request) const {
  if (access_ == Access::kWarp) {
    View view = request.view;
    view.focus.map = nullptr;  // one homography per camera covers one plane: the viewer's focal plane
    view.blending = blending(view.blending);
    return wire::WarpCommand{request, view_warp(rig, ViewPlan(rig, mesh, view))};
  }
  const ViewPlan plan(rig, mesh, request.view);
  wire::PixelCommand command{request, request.view.width, request.view.height, {}};
  for (const CameraIndex camera : plan.contributors())
    command.regions.push_back({camera, needed_pixels(plan, camera, rig.cameras[camera])});
  return command;
}

}  // namespace lf
