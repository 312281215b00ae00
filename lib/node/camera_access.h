// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include "rig/mesh.h"
#include "view/view_request.h"
#include "wire/command_codec.h"

namespace lf {

// Makes the requests for simple cameras, which do not have the rig and therefore cannot compute their contribution to a
// view. Instead of the view request, these cameras receive a command that lists for each camera what it must render or
// send (see RequestPlan). Stateless.
//
// Cameras that have only their own lens parameters (access=warp) receive their triangles of the view and a homography
// from the focal plane to their image, and return their weighted pixels. Cameras that can only deliver pixels
// (access=pixels) receive a rectangle, and return this part of their image. The compositor then warps and weights the
// pixels.
class CameraAccess {
 public:
  // Returns the implementation for this kind of camera. Returns null for cameras that have the rig, because they only
  // need the view request.
  static const CameraAccess* of(Access access);

  // Returns the command for all cameras that contribute to the view. `mesh` must not contain the request's
  // out-of-service cameras.
  wire::AnyRequest command(const Rig& rig, const Mesh& mesh, const ViewRequest& request) const;
  // Returns the blending that these cameras use if a view requests `asked`. Cameras with access=warp always use mesh
  // blending. Other kinds of blending need the weights of a WeightGrid, which one homography per camera cannot express.
  Blending blending(const Blending& asked) const;

 private:
  explicit CameraAccess(Access access) : access_(access) {}

  const Access access_;
};

}  // namespace lf
