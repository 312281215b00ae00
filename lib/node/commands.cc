// SPDX-License-Identifier: LGPL-2.1-or-later
#include "node/commands.h"

#include "render/camera_projection.h"

namespace lf {

wire::WarpCommand warp_command(const Rig& rig, const Mesh& mesh, const ViewRequest& request) {
  View view = request.view;
  view.focus.map = nullptr;  // a matrix for each camera is one plane's: the viewer's
  view.blending = {};        // triangles are the mesh's
  return {request, view_warp(rig, ViewPlan(rig, mesh, view))};
}

wire::PixelCommand pixel_command(const Rig& rig, const Mesh& mesh, const ViewRequest& request) {
  const ViewPlan plan(rig, mesh, request.view);
  wire::PixelCommand command{request, request.view.width, request.view.height, {}};
  for (const CameraIndex camera : plan.contributors())
    command.regions.push_back({camera, needed_pixels(plan, camera, rig.cameras[camera])});
  return command;
}

}  // namespace lf
