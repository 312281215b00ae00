// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <memory>
#include <span>

#include "node/answer_task.h"
#include "rig/mesh.h"
#include "wire/commands.h"

namespace lf {

// How cameras take part in a view that do not know the rig, and so have to be told: by one command for all of them.
// Stateless.
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
  // The task that such a command asks for, see make_task().
  virtual std::unique_ptr<AnswerTask> task(const Rig& rig, const wire::AnyRequest& command,
                                           std::span<const CameraIndex> own,
                                           const ParallelFor& parallel = serial_for) const = 0;
};

// Cameras that know their lens alone: each is told triangles, and the matrix of the focal plane, and gives its part of
// the sum.
const CameraAccess& warp_access();
// Cameras that only have pixels to give: each is told a rectangle of its image, and the compositor warps.
const CameraAccess& pixel_access();

// The task of a request of any kind: `own` are indices of the node's cameras, ascending. `rig` must outlive the task;
// for commands only the lenses and sizes of `own` are looked at. Throws Error for what does not fit the rig.
std::unique_ptr<AnswerTask> make_task(const Rig& rig, MeshCache& mesh, const wire::AnyRequest& request,
                                      std::span<const CameraIndex> own, const ParallelFor& parallel = serial_for);

}  // namespace lf
