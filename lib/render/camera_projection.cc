// SPDX-License-Identifier: LGPL-2.1-or-later
#include "render/camera_projection.h"

namespace lf {

CameraProjection::CameraProjection(const ViewPlan& plan, const Camera& camera)
    : lens_(camera.lens),
      distorted_(camera.lens.has_distortion()),
      right_(camera.width - 0.5),
      bottom_(camera.height - 0.5) {
  const Pose& view = plan.view().pose;
  const Mat3 camera_from_world = glm::transpose(camera.pose.rotation());
  const Mat3 camera_from_view = camera_from_world * view.rotation();
  const Vec3 eye_in_camera = camera_from_world * (view.position - camera.pose.position);
  const double c = plan.focal_offset(), sign = c > 0 ? 1 : -1;
  camera_from_ray_ = sign * (c * camera_from_view + glm::outerProduct(eye_in_camera, plan.focal_normal()));
}

}  // namespace lf
