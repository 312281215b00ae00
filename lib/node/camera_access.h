// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include "rig/mesh.h"
#include "view/view_request.h"
#include "wire/command_codec.h"

namespace lf {

// How cameras take part in a view that do not know the rig, and so have to be told: by one command for all of them,
// which nodes plan as they do a view request (see RequestPlan). Stateless.
class CameraAccess {
 public:
  // Null for cameras that know the rig: a view request says all there is to say.
  static const CameraAccess* of(Access access);

  virtual ~CameraAccess() = default;
  // Tells all cameras that contribute to a view of their parts. `mesh`: without the cameras that the request counts as
  // out of service.
  virtual wire::AnyRequest command(const Rig& rig, const Mesh& mesh, const ViewRequest& request) const = 0;
  // The blending that such cameras can give where a view asks for `asked`.
  virtual Blending blending(const Blending& asked) const { return asked; }
};

// Cameras that know their lens alone: each is told triangles, and the matrix of the focal plane, and gives its part of
// the sum.
const CameraAccess& warp_access();
// Cameras that only have pixels to give: each is told a rectangle of its image, and the compositor warps.
const CameraAccess& pixel_access();

}  // namespace lf
