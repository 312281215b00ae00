// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include "rig/mesh.h"
#include "wire/commands.h"

namespace lf {

// What a camera has to know to take part in a view: the paper's three random access cameras.
enum class Access {
  kSelf,    // its place and its neighbours': it finds out from the view request
  kWarp,    // its lens: it is told triangles, matrices
  kPixels,  // nothing: it is told which of its pixels are wanted, as they are
};

// The commands by which all cameras that contribute to a view are told of their parts. `mesh`: without the cameras that
// the request counts as out of service. Pure.
wire::WarpCommand warp_command(const Rig& rig, const Mesh& mesh, const ViewRequest& request);
wire::PixelCommand pixel_command(const Rig& rig, const Mesh& mesh, const ViewRequest& request);

}  // namespace lf
