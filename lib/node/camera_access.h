// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include "rig/mesh.h"
#include "view/view_request.h"
#include "wire/command_codec.h"

namespace lf {

// Makes the requests for simple cameras, which do not have the rig and therefore cannot compute their contribution to a
// view. Instead of the view request, these cameras receive a command that lists for each camera what it must render or
// send (see RequestPlan). Stateless.
class CameraAccess {
 public:
  // Returns the implementation for this kind of camera. Returns null for cameras that have the rig, because they only
  // need the view request.
  static const CameraAccess* of(Access access);

  virtual ~CameraAccess() = default;
  // Returns the command for all cameras that contribute to the view. `mesh` must not contain the request's
  // out-of-service cameras.
  virtual wire::AnyRequest command(const Rig& rig, const Mesh& mesh, const ViewRequest& request) const = 0;
  // Returns the blending that these cameras use if a view requests `asked`, because some cameras support fewer kinds.
  virtual Blending blending(const Blending& asked) const { return asked; }
};

// For cameras that have only their own lens parameters (access=warp). Each camera receives its triangles of the view
// and a homography from the focal plane to its image, and returns its weighted pixels.
const CameraAccess& warp_access();
// For cameras that can only deliver pixels (access=pixels). Each camera receives a rectangle, and returns this part of
// its image. The compositor then warps and weights the pixels.
const CameraAccess& pixel_access();

}  // namespace lf
