// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include "rig/mesh.h"
#include "view/view_request.h"
#include "wire/command_codec.h"

namespace lf {

// Makes the requests for cameras that do not have the rig and therefore cannot plan a view. Instead of the view
// request, these cameras receive one command, which contains the part of each camera (see RequestPlan). Stateless.
class CameraAccess {
 public:
  // Returns the planner for this kind of camera. Returns null for cameras that have the rig, because they only need the
  // view request.
  static const CameraAccess* of(Access access);

  virtual ~CameraAccess() = default;
  // Returns the command for all cameras that contribute to the view. `mesh` must not contain the request's
  // out-of-service cameras.
  virtual wire::AnyRequest command(const Rig& rig, const Mesh& mesh, const ViewRequest& request) const = 0;
  // Returns the blending that these cameras use if a view requests `asked`, because some cameras support fewer kinds.
  virtual Blending blending(const Blending& asked) const { return asked; }
};

// For cameras that have only their own lens parameters. Each receives triangles and a homography of the focal plane,
// and returns its part of the sum.
const CameraAccess& warp_access();
// For cameras that can only deliver pixels. Each receives a rectangle of its image, and the compositor warps the
// pixels.
const CameraAccess& pixel_access();

}  // namespace lf
