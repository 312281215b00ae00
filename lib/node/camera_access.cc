// SPDX-License-Identifier: LGPL-2.1-or-later
#include "node/camera_access.h"

#include "render/camera_projection.h"
#include "render/view_plan.h"

namespace lf {

const CameraAccess* CameraAccess::of(Access access) {
  switch (access) {
    case Access::kSelf: break;
    case Access::kWarp: return &warp_access();
    case Access::kPixels: return &pixel_access();
  }
  return nullptr;
}

namespace {

class WarpAccess : public CameraAccess {
 public:
  wire::AnyRequest command(const Rig& rig, const Mesh& mesh, const ViewRequest& request) const override {
    View view = request.view;
    view.focus.map = nullptr;  // one homography per camera covers one plane: the viewer's focal plane
    view.blending = blending(view.blending);
    return wire::WarpCommand{request, view_warp(rig, ViewPlan(rig, mesh, view))};
  }
  // These cameras always use mesh blending. Other kinds of blending need the weights of a WeightGrid, which one
  // homography per camera cannot express.
  Blending blending(const Blending&) const override { return {.extrapolates = false}; }
};

class PixelAccess : public CameraAccess {
 public:
  wire::AnyRequest command(const Rig& rig, const Mesh& mesh, const ViewRequest& request) const override {
    const ViewPlan plan(rig, mesh, request.view);
    wire::PixelCommand command{request, request.view.width, request.view.height, {}};
    for (const CameraIndex camera : plan.contributors())
      command.regions.push_back({camera, needed_pixels(plan, camera, rig.cameras[camera])});
    return command;
  }
};

}  // namespace

const CameraAccess& warp_access() {
  static const WarpAccess access;
  return access;
}

const CameraAccess& pixel_access() {
  static const PixelAccess access;
  return access;
}

}  // namespace lf
