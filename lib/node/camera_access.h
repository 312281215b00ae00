// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include "rig/mesh.h"
#include "view/view_request.h"
#include "wire/command_codec.h"

namespace lf {

// Plans a view for cameras that do not know the rig: a single command for all these cameras replaces the view request
// (see RequestPlan). Stateless.
class CameraAccess {
 public:
  // Returns null for cameras that know the rig and only need the view request.
  static const CameraAccess* of(Access access);

  virtual ~CameraAccess() = default;
  // Returns the command that assigns each contributing camera its part. `mesh`: without the out-of-service cameras of
  // the request.
  virtual wire::AnyRequest command(const Rig& rig, const Mesh& mesh, const ViewRequest& request) const = 0;
  // Returns the blending that these cameras support when a view asks for `asked`.
  virtual Blending blending(const Blending& asked) const { return asked; }
};

// For cameras that know only their lens. Each receives triangles and a homography of the focal plane, and returns its
// part of the sum.
const CameraAccess& warp_access();
// For cameras that can only deliver pixels. Each receives a rectangle of its image; the compositor warps the pixels.
const CameraAccess& pixel_access();

}  // namespace lf
