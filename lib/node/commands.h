// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include "rig/mesh.h"
#include "wire/commands.h"

namespace lf {

// The commands by which all cameras that contribute to a view are told of their parts. `mesh`: without the cameras that
// the request counts as out of service. Pure.
wire::WarpCommand warp_command(const Rig& rig, const Mesh& mesh, const ViewRequest& request);
wire::PixelCommand pixel_command(const Rig& rig, const Mesh& mesh, const ViewRequest& request);

}  // namespace lf
