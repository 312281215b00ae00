// SPDX-License-Identifier: LGPL-2.1-or-later
#include "node/camera_access.h"

namespace lf {

const CameraAccess* CameraAccess::of(Access access) {
  switch (access) {
    case Access::kSelf: break;
    case Access::kWarp: return &warp_access();
    case Access::kPixels: return &pixel_access();
  }
  return nullptr;
}

std::unique_ptr<AnswerTask> make_task(const Rig& rig, MeshCache& mesh, const wire::AnyRequest& request,
                                      std::span<const CameraIndex> own, const ParallelFor& parallel) {
  if (const CameraAccess* access = CameraAccess::of(wire::access_of(request)))
    return access->task(rig, request, own, parallel);
  const auto& view = std::get<ViewRequest>(request);
  return make_task(rig, mesh.get(rig, view.out_of_service), view, own, parallel);
}

}  // namespace lf
